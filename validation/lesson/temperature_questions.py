"""What grade.py asks of the functions of temperature.py, and common mistakes, each by what it answers.

Draws are from a script, so a random step is judged to rounding like any other.  Sources: Leimkuhler &
Matthews, Appl. Math. Res. Express 2013, 34 (splittings and their averages); Zhang et al., J. Phys. Chem. A
123 (2019) 6056 (velocities half a step away).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from typing import Any

import numpy as np

Cases = list[tuple[Any, ...]]

EPS = float(np.finfo(float).eps)

NEAR = 1e-9
"""A mistake is known by its first nine digits: others differ in the second."""

Law = Callable[..., Any]


@dataclass(frozen=True, kw_only=True)
class Question:
    """What a function is asked, and what common mistakes would have answered."""

    cases: Cases
    right: Law
    slips: dict[str, Law]
    look: str
    also: tuple[Law, ...] = ()
    """Other answers that are right as well."""
    residual: Callable[[Cases, list[Any]], bool] | None = None
    """Whether answers solve an equation to rounding, in the place of being those of `right`."""

    def same(self, answers: list[Any], other: Law, room: float = 64 * EPS) -> bool:
        """Whether these are the answers of another function, to `room` times the sizes of what is added up.

        64 EPS: no case has 1 - c**2, 1 - (h w)**2/4 or 1 - r**2 below a sixth, so each multiplies the
        rounding of what it is made of by six at most; none has more than twenty operations of half an EPS.
        """
        for case, answer in zip(self.cases, answers, strict=True):
            wanted = np.asarray(other(*case), float)
            size = _size(*case) if len(case) == 8 else np.max(np.abs(wanted))
            if not np.all(np.abs(answer - wanted) <= room * size):
                return False
        return True

    def slip(self, answers: list[Any]) -> str | None:
        """What is wrong with answers: a common mistake, or where to look; None where they are right."""
        of_laws = any(self.same(answers, law) for law in (self.right, *self.also))
        if self.residual(self.cases, answers) if self.residual else of_laws:
            return None
        if self.same(answers, self.right, NEAR):
            return "right to nine digits, not to rounding: is a constant cut short, or an iteration?"
        return next(
            (said for said, wrong in self.slips.items() if self.same(answers, wrong, NEAR)), self.look
        )

    def told(self, answer: Any) -> str:
        """The first case and an answer to it."""
        names = signature(self.right).parameters
        given = (
            f"{name} = {_short(x)}" for name, x in zip(names, self.cases[0], strict=True) if not callable(x)
        )
        return f"at {', '.join(given)} it answers {_short(answer)}"


def _short(value: Any) -> str:
    return " ".join(np.array2string(np.asarray(value), precision=6, separator=", ").split())


def _size(q: Any, p: Any, h: Any, force: Any, mass: Any, _: Any, kT: Any, xi: Any) -> float:
    """The sizes of what a step adds up."""
    momenta = abs(p) + h * abs(force(q)) + math.sqrt(mass * kT) * float(np.sum(np.abs(xi)))
    return float(abs(q) + momenta * (1 + h / mass))


def splitting(
    letters: str, *, decay: Law | None = None, noise: Law | None = None, tempo: bool = False,
    stale: bool = False, light: bool = False, once: bool = False,
) -> Law:  # fmt: skip
    """A Langevin step by its letters.

    Faults: another c(gamma, t) or s(m, kT, c, gamma, t), gamma h for h, one force for all kicks, no mass in
    the drift, one draw for all.
    """

    def step(q: Any, p: Any, h: Any, force: Any, mass: Any, gamma: Any, kT: Any, xi: Any) -> Any:
        draws, first, move = list(np.atleast_1d(xi)), force(q), gamma * h if tempo else h
        for letter in letters:
            t = (h if letter == "O" else move) / letters.count(letter)
            if letter == "B":
                p = p + t * (first if stale else force(q))
            elif letter == "A":
                q = q + t * p / (1 if light else mass)
            else:
                c = (decay or _left)(gamma, t)
                p = c * p + (noise or _kept)(mass, kT, c, gamma, t) * (draws[0] if once else draws.pop(0))
        return q, p

    return step


def _left(gamma: float, t: float) -> float:
    return math.exp(-gamma * t)


def _kept(m: float, kT: float, c: float, *_: float) -> float:
    return math.sqrt(m * kT * (1 - c * c))


DECAYS: dict[str, Law] = {
    "friction lasts too long: exp(-gamma t) is left after a time t": lambda g, t: math.exp(-2 * g * t),
    "friction ends too early: exp(-gamma t) is left after a time t": lambda g, t: math.exp(-g * t / 2),
    "gamma is missing in the friction: exp(-gamma t), not exp(-t)": lambda _, t: math.exp(-t),
    "the time is missing in the friction: exp(-gamma t), not exp(-gamma)": lambda g, _: math.exp(-g),
    "1 - gamma t is friction to first order; the exact move leaves exp(-gamma t)": lambda g, t: 1 - g * t,
    "gamma t is no factor of friction: exp(-gamma t) is left": lambda g, t: g * t,
}
"""Wrong frictions."""

NOISES: dict[str, Law] = {
    "the variance stands for the standard deviation: s is the root of m kT (1 - c**2)": (
        lambda m, kT, c, *_: m * kT * (1 - c * c)
    ),
    "c stands for sqrt(1 - c**2) in the noise: it replaces what friction took": (
        lambda m, kT, c, *_: math.sqrt(m * kT) * c
    ),
    "1 - c stands for 1 - c**2: variances add up, c**2 m kT + s**2 = m kT": (
        lambda m, kT, c, *_: math.sqrt(m * kT * (1 - c))
    ),
    "1 - c**2 is missing in the noise: it replaces what friction took, no more": (
        lambda m, kT, *_: math.sqrt(m * kT)
    ),
    "sqrt(m) is missing in the noise: the variance of p is m kT; a mass of 1 hides it": (
        lambda m, kT, c, *_: math.sqrt(kT * (1 - c * c))
    ),
    "this is the noise of a velocity, kT/m: the variance of the momentum is m kT": (
        lambda m, kT, c, *_: math.sqrt(kT / m * (1 - c * c))
    ),
    "m stands before the root: sqrt(m kT (1 - c**2))": lambda m, kT, c, *_: m * math.sqrt(kT * (1 - c * c)),
    "2 gamma m kT t is the variance to first order; the exact move has m kT (1 - c**2)": (
        lambda m, kT, _, g, t: math.sqrt(2 * g * m * kT * t)
    ),
    "there is no noise: friction alone cools the spring to nothing": lambda *_: 0.0,
}
"""Wrong noises."""


def _steps(letters: str, others: dict[str, str]) -> dict[str, Law]:
    """Wrong steps, each with its sentence; friction and noise may be wrong together."""
    right = splitting(letters)
    slips = {said: splitting(letters, decay=wrong) for said, wrong in DECAYS.items()}
    slips |= {said: splitting(letters, noise=wrong) for said, wrong in NOISES.items()}
    slips |= {said: splitting(wrong) for said, wrong in others.items()}
    slips |= {
        "gamma h stands for h: kicks and drifts know nothing of friction": splitting(letters, tempo=True),
        "the last kick takes the force of the first: the position has moved": splitting(letters, stale=True),
        "the mass is missing in the drift: dq/dt = p/m": splitting(letters, light=True),
        "(q, p) look exchanged: a step returns the position first": lambda *a: right(*a)[::-1],
        "momentum or velocity? It returns v, and p = m v is asked for": (
            lambda *a: (right(*a)[0], right(*a)[1] / a[4])
        ),
    }
    if letters.count("O") > 1:
        slips["one draw is used twice: the two of a step are independent"] = splitting(letters, once=True)
    slips |= {
        f"two things. {first}; {second}": splitting(letters, decay=decay, noise=noise)
        for first, decay in DECAYS.items()
        for second, noise in NOISES.items()
    }
    return slips


def _of_opposite(law: Law) -> Law:
    """A step with the opposite draws, which are as likely: s may be a negative root."""
    return lambda *a: law(*a[:-1], -np.asarray(a[-1]))


def _of_few(n: int, r: float) -> float:
    """The relative error of a mean of n squares, for any n: two of them are j apart n - j times."""
    j = np.arange(1, n)
    return math.sqrt(2 / n * (1 + 2 * float(np.sum((1 - j / n) * float(r) ** (2 * j)))))


def _springs(draws: int) -> Cases:
    """Scripted states, draws and parameters; the force is not linear: every kick shows where it was."""
    script = np.random.default_rng(7)
    cases: Cases = []
    for mass, gamma, kT, h in ((1.7, 2.3, 0.6, 0.31), (0.4, 1.6, 2.2, 0.23), (3.1, 0.7, 1.3, 0.57)):
        q, p, *xi = (float(x) for x in script.normal(size=2 + draws))
        force = lambda q: -1.3 * q - 0.4 * q**3  # noqa: E731
        cases += [(q, p, h, force, mass, gamma, kT, xi[0] if draws == 1 else tuple(xi))]
        cases += [(0.0, 0.0, h, force, mass, gamma, kT, 1.0 if draws == 1 else (1.0, -2.0))]
    return cases


def _lyapunov(A: Any, G: Any) -> Any:
    """S = A S A' + G G', by its sum."""
    S, term = np.zeros_like(A), G @ G.T
    for _ in range(2000):
        S, term = S + term, A @ term @ A.T
    return S


def _continuous(A: Any, G: Any) -> Any:
    one = np.eye(len(A))
    return np.linalg.solve(np.kron(A, one) + np.kron(one, A), -(G @ G.T).ravel()).reshape(A.shape)


def _solved(cases: Cases, answers: list[Any]) -> bool:
    """Whether S = A S A' + G G', to the rounding of sums of 2 n + 1 terms, sixteen times."""
    return all(
        bool(
            np.all(
                np.abs(S - A @ S @ A.T - G @ G.T)
                <= 16 * (2 * len(A) + 1) * EPS * np.max(np.abs(S) + np.abs(A) @ np.abs(S) @ np.abs(A.T))
            )
        )
        for (A, G), S in zip(cases, answers, strict=True)
    )


WAVES: Cases = [(0.31, 2.3), (1.2, 0.7), (0.05, 17.0)]

_WHERE = "its draws tell: at q = p = 0 and a draw of 1, what momentum comes out, and what without a draw?"

QUESTIONS: dict[str, Question] = {
    "baoab": Question(
        cases=_springs(1),
        right=splitting("BAOAB"),
        slips=_steps("BAOAB", {"this is ABOBA: kicks come first and last": "ABOBA",
                               "this is BAOA, whose kick is whole: BAOAB ends with half a kick": "BAOA"}),
        also=(_of_opposite(splitting("BAOAB")),),
        look=f"kick h/2, drift h/2, friction and noise h, drift h/2, kick h/2; {_WHERE}",
    ),
    "kinetic": Question(
        cases=[(*wave, T) for wave, T in zip(WAVES, (300.0, 1.9, 0.7), strict=True)],
        right=lambda h, w, T: (T * (1 - (h * w) ** 2 / 4), T),
        slips={
            "the two are exchanged: the velocity that is stored with the position is the cold one": (
                lambda h, w, T: (T, T * (1 - (h * w) ** 2 / 4))
            ),
            "only one of the two velocities has the bath's temperature": lambda h, w, T: (T, T),
            "only one of the two velocities is cold": lambda h, w, T: (T * (1 - (h * w) ** 2 / 4),) * 2,
            "a half for a quarter: half a kick moves p by h/2, and its square counts": (
                lambda h, w, T: (T * (1 - (h * w) ** 2 / 2), T)
            ),
            "the quarter is missing: half a kick moves p by h/2, and its square counts": (
                lambda h, w, T: (T * (1 - (h * w) ** 2), T)
            ),
            "h w/2 is not squared: an error of a symmetric step has even powers of h": (
                lambda h, w, T: (T * (1 - h * w / 2), T)
            ),
            "h stands for h w: a number that is compared with 1 has no unit": (
                lambda h, w, T: (T * (1 - h**2 / 4), T)
            ),
            "the velocity on site is colder than the bath, not hotter": (
                lambda h, w, T: (T / (1 - (h * w) ** 2 / 4), T)
            ),
            "T is missing: ratios are returned, and temperatures are asked for": (
                lambda h, w, T: (1 - (h * w) ** 2 / 4, 1.0)
            ),
        },
        look="half a kick and half a drift stand between the two; <q**2> = kT/k at every h",
    ),
    "configurational": Question(
        cases=WAVES,
        right=lambda h, w: 1 / (1 - (h * w) ** 2 / 4),
        slips={
            "upside down: that is OABAO's; OBABO's positions are too hot": lambda h, w: 1 - (h * w) ** 2 / 4,
            "1 is BAOAB's: its positions are right and its velocities are not": lambda h, w: 1.0,
            "1 + (h w)**2/4 is where the series begins; the law is exact": lambda h, w: 1 + (h * w) ** 2 / 4,
            "a half for a quarter: it must grow without bound at h w = 2, the limit of stability": (
                lambda h, w: 1 / (1 - (h * w) ** 2 / 2)
            ),
            "the quarter is missing: it must grow without bound at h w = 2, the limit of stability": (
                lambda h, w: 1 / (1 - (h * w) ** 2)
            ),
            "h w/2 is not squared: an error of a symmetric step has even powers of h": (
                lambda h, w: 1 / (1 - h * w / 2)
            ),
            "h stands for h w: a number that is compared with 1 has no unit": lambda h, w: 1 / (1 - h**2 / 4),
        },
        look="without friction OBABO is velocity Verlet: which quadratic form of (q, p) does that keep?",
    ),
    "stationary": Question(
        cases=[
            (np.array([[0.8, 0.3], [-0.5, 0.6]]), np.array([[0.2], [0.7]])),
            (np.array([[0.5, 0.4, 0.0], [-0.3, 0.6, 0.1], [0.2, 0.0, 0.7]]),
             np.array([[0.3, 0.0], [0.5, -0.4], [0.1, 0.9]])),
        ],
        right=_lyapunov,
        residual=_solved,
        slips={
            "G G' is the covariance of one step's noise: what earlier steps left is missing": (
                lambda A, G: G @ G.T
            ),
            "A and its transpose are exchanged: <A z (A z)'> = A <z z'> A'": lambda A, G: _lyapunov(A.T, G),
            "A S + S A' + G G' = 0 is that of continuous time; a step has S = A S A' + G G'": _continuous,
            "A acts once and not twice: a covariance has A on its left and A' on its right": (
                lambda A, G: np.linalg.solve(np.eye(len(A)) - A, G @ G.T)
            ),
            "this is S after one more step only: iterate until nothing changes": (
                lambda A, G: G @ G.T + A @ G @ G.T @ A.T
            ),
        },
        look="S is the mean of z z', and stays so when z becomes A z + G xi; iterate until nothing changes",
    ),
    "error": Question(
        cases=[(1000, 0.3), (20000, 0.9), (400, -0.5)],
        right=lambda n, r: math.sqrt(2 / n * (1 + r * r) / (1 - r * r)),
        slips={
            "states are counted as if they were independent: r is missing": lambda n, r: math.sqrt(2 / n),
            "r for r**2: squares of normal numbers are correlated by r**2, r**4, ...": (
                lambda n, r: math.sqrt(2 / n * (1 + r) / (1 - r))
            ),
            "the variance stands for the standard deviation: the error is its root": (
                lambda n, r: 2 / n * (1 + r * r) / (1 - r * r)
            ),
            "the 2 is missing: <q**4> = 3 <q**2>**2, so squares vary by twice their mean squared": (
                lambda n, r: math.sqrt(1 / n * (1 + r * r) / (1 - r * r))
            ),
            "upside down: correlated states tell less, so the error grows": (
                lambda n, r: math.sqrt(2 / n * (1 - r * r) / (1 + r * r))
            ),
            "correlations are counted on one side: earlier states count as later ones, 1 + 2 sum r**(2j)": (
                lambda n, r: math.sqrt(2 / n / (1 - r * r))
            ),
        },
        also=(_of_few,),
        look="sqrt(2/N), N independent states of n: 1/N = (1 + 2 sum of the correlations of q**2)/n",
    ),
    "obabo": Question(
        cases=_springs(2),
        right=splitting("OBABO"),
        slips=_steps("OBABO", {}),
        # the draws of a pair are independent, and each is as likely as its opposite
        also=tuple(law for one in (splitting("OBABO"), lambda *a: splitting("OBABO")(*a[:-1], a[-1][::-1]))
                   for law in (one, _of_opposite(one))),
        look=f"O h/2, kick h/2, drift h, kick h/2, O h/2; {_WHERE}",
    ),
}  # fmt: skip
"""The functions of temperature.py."""
