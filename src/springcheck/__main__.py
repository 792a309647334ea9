"""``springcheck`` and ``python -m springcheck``."""

import gc
import os
import sys
import warnings

from springcheck import interrupts


def main() -> int:
    """The command line as a program of its own, which can be interrupted from its first line on."""
    status = interrupts.supervised()
    return interrupts.over(interrupts.ends(_main())) if status is None else status


def _main() -> int:
    interrupts.install()
    # imported modules stay alive: no garbage collection until the command begins its work
    gc.disable()
    # figures are drawn without any window; what matplotlib does not know is said by `plot`
    os.environ.setdefault("MPLBACKEND", "agg")
    try:
        from springcheck import cli
        from springcheck.cli import slips

        slips.open_streams()
        if not sys.warnoptions:
            # the tests make errors of them; a user can do nothing about NumPy's
            warnings.simplefilter("ignore")
        status = cli.main()
        interrupts.finish()
        # objects live until the command ends: the interpreter need not collect cycles at exit
        gc.freeze()
    except SystemExit as ended:
        # argparse: --help, or a mistake that it has named
        status = ended.code if isinstance(ended.code, int) else 2
    except BaseException as error:
        # an import that was interrupted may raise an error of its own
        if interrupts.seen():
            interrupts.leave()
        if isinstance(error, BrokenPipeError):
            status = interrupts.unread()
        elif not isinstance(error, Exception) or os.environ.get("SPRINGCHECK_TRACEBACK"):
            raise
        else:
            sys.stderr.write(f"springcheck: {slips.one_line(error)}\n")
            status = 2
    if interrupts.seen():
        interrupts.leave()
    return status


if __name__ == "__main__":
    sys.exit(main())
