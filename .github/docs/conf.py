"""The documentation site, from the repository's own files.

    python -m pip install '.' --group docs
    sphinx-build --fail-on-warning --keep-going -c .github/docs . build/site

The source folder is the repository: every document stays where it is, and its links lead on.  The front page
is README.md; the API reference comes from docstrings, and `gallery.py` runs the scenes.
"""

import sys
from pathlib import Path
from shutil import copyfile
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import gallery

import springcheck

project, author, version = "springcheck", "The springcheck authors", springcheck.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
root_doc = "README"
include_patterns = [
    "README.md", "data/README.md", "src/springcheck/README.md", "src/springcheck/*/README.md",
    "validation/*.md", "validation/engines/*.md", "validation/lesson/*.md", "validation/teaching/*.md",
    "validation/upstream/*.md", ".github/*.md", ".github/actions/judge/README.md", ".github/docs/api.md",
    "build/docs/*.md",
]  # fmt: skip
exclude_patterns = ["validation/lesson/paper.md"]
html_theme = "furo"
html_title = f"springcheck {version}"
html_copy_source = False
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence"]
numpydoc_show_class_members = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
# links to scripts and folders are no pages of the site; tests/test_readme.py finds dead ones
suppress_warnings = ["myst.xref_missing", "myst.header"]

CONTENTS = """

```{toctree}
:hidden:
:caption: Use

validation/howto
build/docs/gallery
data/README
src/springcheck/engines/README
.github/actions/judge/README
validation/lesson/lesson
validation/lesson/ten-minutes
```

```{toctree}
:hidden:
:caption: Reference

.github/docs/api
src/springcheck/README
.github/CONTRIBUTING
.github/CHANGELOG
```

```{toctree}
:hidden:
:caption: Evidence

validation/README
validation/upstream/README
validation/teaching/README
validation/lesson/README
```
"""
FINDINGS = """

```{toctree}
:hidden:
:glob:

*
```
"""
"""What is added to the findings' own page."""


def _add_contents(app: Any, name: str, text: list[str]) -> None:
    text[0] += {root_doc: CONTENTS, "validation/upstream/README": FINDINGS}.get(name, "")


def _front_page(app: Any, error: Exception | None) -> None:
    if error is None and app.builder.name == "html":
        copyfile(app.outdir / "README.html", app.outdir / "index.html")


def setup(app: Any) -> None:
    """Make the gallery first, add the contents to the front page, and name it index.html too."""
    app.connect("builder-inited", lambda app: gallery.write(Path(app.srcdir, "build", "docs")))
    app.connect("source-read", _add_contents)
    app.connect("build-finished", _front_page)
