"""Grade steppers: python grade.py exercises.py; exit status 0 where all are right, 1 not yet, 2 unreadable.

    python grade.py FILE.py            right, or not yet
    python grade.py FILE.py --hint     and what the states show, and where to look
    python grade.py FILE.py --answer   and what was wrong, where solutions.py lies beside this file

`springcheck identify` says which scheme the states of each function show, and whether all of them fit it to
rounding.  Functions of temperature.py are asked what laws answer, and random steps get draws from a script;
these are judged to rounding too.  What a function prints is kept back; one that takes longer than five
seconds is stopped.
"""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import schemes
from springcheck.engines import module_of
from springcheck.errors import SpringcheckError
from springcheck.identify import identify_stepper
from springcheck.identify.catalogue import names, title

AIMS = {
    "one": "semi-implicit-euler",
    "two": "velocity-verlet",
    "three": "implicit-euler",
    "four": "semi-implicit-euler-drift-kick",
    "five": "velocity-verlet",
    "six": "rk4",
}
"""What each is meant to be, whatever the file says; of other exercises the file's own `AIMS` does."""

NAMED = {*schemes.known(), *names()}
"""What a function may be meant to be: the schemes that have a name here."""

SECONDS = 5.0

Step = Callable[..., Any]


class TooLongError(KeyboardInterrupt):
    """The clock's Ctrl-C: passes by whoever catches the mistakes of a function, whatever they leave by."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Stop what takes longer, where the system has timers."""

    def stop(*_: object) -> None:
        raise TooLongError

    if not hasattr(signal, "setitimer"):
        yield
        return
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def shows(step: Step, aim: str) -> tuple[bool, str]:
    """Whether the states of a function are those of a scheme, and what they show."""
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()), limited(SECONDS):
            found = identify_stepper(step)
    except TooLongError:
        return False, f"stopped after {SECONDS:g} s: does a loop in it never end?"
    except SpringcheckError as error:
        return False, f"it is no stepper: {error}"
    return bool(found.fits) and aim in (found.scheme, *found.aliases), found.statement


def _exchanged(step: Step) -> Step:
    return lambda q, p, h, force, mass: tuple(step(q, p, h, force, mass))[::-1]


def _velocity_out(step: Step) -> Step:
    def other(q: Any, p: Any, h: Any, force: Any, mass: Any) -> Any:
        q, v = step(q, p, h, force, mass)
        return q, v * mass

    return other


def _velocity(step: Step) -> Step:
    def other(q: Any, p: Any, h: Any, force: Any, mass: Any) -> Any:
        q, v = step(q, p / mass, h, force, mass)
        return q, v * mass

    return other


SLIPS: dict[str, Callable[[Step], Step]] = {
    "(q, p) look exchanged: a step returns the position first": _exchanged,
    "momentum or velocity? It returns v, and p = m v is asked for": _velocity_out,
    "momentum or velocity? It takes p for v: what it is given is the momentum p = m v": _velocity,
}
"""What the function does after all, once this is undone."""


def hint(step: Step, aim: str, seen: str) -> str:
    """Where to look, after what the states of the function show."""
    for said, undone in SLIPS.items():
        if shows(undone(step), aim)[0]:
            return said
    scheme = schemes.known().get(aim)
    if scheme is None:
        return f"hold it beside {title(aim)}; try a mass that is not 1"
    if scheme.has("implicit") and " on a spring, and another scheme on forces that are not linear" in seen:
        return "it is right for a force that is proportional to q; solve the equation for any force"
    if scheme.has("implicit"):
        return "iterate further: the equation of the step is solved when another round changes nothing"
    stages = " then ".join(
        f"{kind.name} {c}" for kind, (_, c) in zip(scheme.kinds, scheme.stages, strict=True)
    )
    return f"hold it beside {scheme.title}{f': {stages}' if stages else ''}; try a mass that is not 1"


def asked_of(module: Any) -> dict[str, Any]:
    """What is asked of a file: steppers by the schemes that they are meant to be, or questions."""
    if hasattr(module, "AIMS"):
        return {name: AIMS.get(name) or str(aim) for name, aim in dict(module.AIMS).items()}
    place = Path(__file__).with_name("temperature_questions.py")
    if any(hasattr(module, name) for name in AIMS) or not place.is_file():
        return dict(AIMS)
    asked: dict[str, Any] = module_of(place).QUESTIONS
    return asked if any(hasattr(module, name) for name in asked) else dict(AIMS)


def answered(function: Step, asked: Any) -> tuple[bool, str, str]:
    """Whether a function answers a question rightly, what it answers, and where to look."""
    answers = []
    for case in asked.cases:
        given = [x.copy() if isinstance(x, np.ndarray) else x for x in case]
        try:
            with redirect_stdout(StringIO()), redirect_stderr(StringIO()), limited(SECONDS):
                answer = function(*given)
            if answer is None or (isinstance(answer, tuple) and any(x is None for x in answer)):
                return False, "it is no answer yet: nothing is returned", asked.look
            answers.append(np.asarray(answer, float))
        except TooLongError:
            return False, f"stopped after {SECONDS:g} s: does a loop in it never end?", asked.look
        except (Exception, SystemExit) as error:
            return False, f"it is no answer: {type(error).__name__}: {error}", asked.look
    wanted = [np.shape(asked.right(*case)) for case in asked.cases]
    for answer, shape in zip(answers, wanted, strict=True):
        if answer.shape != shape:
            return (
                False,
                f"it is no answer: its shape is {answer.shape}, and {shape} is asked for",
                asked.look,
            )
    said = asked.slip(answers)
    return said is None, "to rounding" if said is None else asked.told(answers[0]), said or ""


def judge(function: Any, asked: Any, *, look: bool) -> tuple[bool, str, str]:
    """Whether a function is right, what it shows, and where to look, if that is asked for."""
    if not isinstance(asked, str):
        return answered(function, asked)
    right, said = shows(function, asked)
    return right, said, hint(function, asked, said) if look and not right else ""


def main(arguments: list[str]) -> int:
    """Print a line for each stepper, and what is asked for below it."""
    files = [one for one in arguments if not one.startswith("--")]
    wanted = set(arguments) - set(files)
    if wanted - {"--hint", "--answer"} or len(files) > 1:
        print("usage: python grade.py FILE.py [--hint] [--answer]")
        return 2
    path = Path(files[0] if files else "exercises.py").resolve()
    sys.path.insert(0, str(path.parent))
    try:
        with redirect_stdout(StringIO()), limited(SECONDS):
            module = module_of(path)
    except SpringcheckError as error:
        print(error)
        return 2
    except TooLongError:
        print(f"{path.name}: stopped after {SECONDS:g} s, before a function was called")
        return 2
    finally:
        sys.path.remove(str(path.parent))
    asked = asked_of(module)
    for name, aim in asked.items():
        if isinstance(aim, str) and aim not in NAMED:
            print(f"{path.name}: AIMS: {name}: {aim!r} is no scheme here{schemes.meant(aim)}")
            return 2
    if not any(hasattr(module, name) for name in asked):
        beside = Path(__file__).with_name("temperature_questions.py").is_file()
        more = "" if beside else "; those of temperature need temperature_questions.py beside grade.py"
        print(f"{path.name} has none of the functions {', '.join(asked)}{more}")
        return 2
    mended = 0
    for name, question in asked.items():
        function = getattr(module, name, None)
        right, said, look = False, f"{path.name} has no function {name}", ""
        if callable(function):
            right, said, look = judge(function, question, look=bool(wanted))
        mended += right
        told = right or said.startswith(("it is no", "stopped", path.name)) or wanted
        verdict = f"{'right' if right else 'not yet'}{f': {said}' if told else ''}"
        print(f"{name:{max(6, *map(len, asked))}} {verdict}")
        if look and wanted:
            print(f"       look: {look}")
        if not right and "--answer" in wanted:
            print(f"       answer: {answer(name)}")
    more = "" if mended == len(asked) or wanted else "; --hint says where to look"
    print(f"{mended} of {len(asked)}{more}")
    return 0 if mended == len(asked) else 1


def answer(name: str) -> str:
    """What was wrong, as the solutions say it."""
    places = [Path(__file__).with_name(name) for name in ("solutions.py", "temperature_solutions.py")]
    sys.path.insert(0, str(places[0].parent))
    try:
        known = [module_of(place) for place in places if place.is_file()]
    finally:
        sys.path.remove(str(places[0].parent))
    if not known:
        return "your teacher has it"
    found = next((getattr(module, name) for module in known if hasattr(module, name)), None)
    return " ".join((found.__doc__ or "").split()) if found else "none is known"


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
