"""The command lines of the validation scripts: a few positional arguments, and --help with the docstring."""

from __future__ import annotations

import argparse
from typing import Any


def arguments(description: str | None, **defaults: Any) -> argparse.Namespace:
    """Positional arguments, each left out at will: defaults, whose types they have, or types alone."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in defaults.items():
        if isinstance(default, list):
            parser.add_argument(name, nargs="*", default=default)
        elif isinstance(default, type):
            parser.add_argument(name, nargs="?", type=default)
        else:
            parser.add_argument(name, nargs="?", type=type(default), default=default)
    return parser.parse_args()
