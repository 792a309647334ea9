"""Hatch's metadata hook: the README of the package page, whose relative links lead to the repository.

The repository's address stands in pyproject.toml alone, under [project.urls].
"""

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface


class Readme(MetadataHookInterface):
    """Sets `readme` from README.md."""

    def update(self, metadata: dict[str, object]) -> None:
        """Rewrite links to files and pictures of the repository into addresses."""
        home, text = metadata["urls"]["Source"], Path(self.root, "README.md").read_text(encoding="utf-8")
        text = re.sub(r"(!\[[^]]*\])\((?!\w+:|#)([^)]+)\)", rf"\1({home}/raw/HEAD/\2)", text)
        text = re.sub(r"(?<!!)(\[[^]]*\])\((?!\w+:|#)([^)]+)\)", rf"\1({home}/blob/HEAD/\2)", text)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
