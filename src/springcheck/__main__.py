"""``python -m springcheck``."""

import sys

from springcheck.cli import main

sys.exit(main())
