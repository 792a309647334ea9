"""``springcheck`` and ``python -m springcheck``."""

import atexit
import contextlib
import gc
import os
import sys
import warnings

from springcheck import interrupts

BROKEN_PIPE = 141
"""Exit status of a program whose output nobody reads any more: 128 + SIGPIPE, as in shells."""


def main() -> int:
    """The command line as a program of its own, which can be interrupted from its first line on."""
    for stream in (0, 1, 2):
        try:
            os.fstat(stream)
        except OSError:
            # a file that is opened later would take its descriptor, and receive what is printed
            os.open(os.devnull, os.O_RDONLY if stream == 1 else os.O_RDWR)
    interrupts.install()
    status = _main()
    if interrupts.seen():
        interrupts.leave()
    if sys.getprofile() is None and sys.gettrace() is None:
        # the interpreter would tear down every module first, a twentieth of the smallest run's time, and wait
        # for threads that a plug-in or a library has left
        atexit._run_exitfuncs()
        for output in (sys.stdout, sys.stderr):
            # as far as they are open
            with contextlib.suppress(OSError, ValueError, AttributeError):
                output.flush()
        os._exit(status)
    return status


def _main() -> int:
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
        # objects live until the command ends: the interpreter need not collect cycles at exit
        gc.freeze()
        return status
    except SystemExit as ended:
        # argparse: --help, or a mistake that it has named
        return ended.code if isinstance(ended.code, int) else 2
    except BaseException as error:
        # an import that was interrupted may raise an error of its own
        if interrupts.seen():
            interrupts.leave()
        if isinstance(error, BrokenPipeError):
            for stream in (1, 2):
                # at shutdown the interpreter would complain that buffered output cannot be written
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
            return BROKEN_PIPE
        if not isinstance(error, Exception) or os.environ.get("SPRINGCHECK_TRACEBACK"):
            raise
        sys.stderr.write(f"springcheck: {slips.one_line(error)}\n")
        return 2


if __name__ == "__main__":
    sys.exit(main())
