"""``springcheck`` and ``python -m springcheck``."""

import sys

from springcheck import interrupts


def main() -> int:
    """The command line as a program of its own, which can be interrupted from its first line on."""
    interrupts.install()
    try:
        from springcheck import cli

        status = cli.main()
        interrupts.finish()
    except BaseException:
        # an import that was interrupted may raise an error of its own
        if not interrupts.seen():
            raise
        interrupts.leave()
    if interrupts.seen():
        interrupts.leave()
    return status


if __name__ == "__main__":
    sys.exit(main())
