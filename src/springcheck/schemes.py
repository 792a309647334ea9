"""The mathematics of the methods: one-step maps as data, and what follows from them exactly.

A scheme is either a splitting (a sequence of kicks ``p += c h F(q)``, drifts ``q += d h p/m`` and
frictions ``p *= exp(-c h gamma)``) or a Runge-Kutta tableau.  Coefficients are exact: fractions, or
decimal strings of 40 digits where they are irrational.  `step` carries out a scheme in the width of the
numbers it is given; everything else (matrix, determinant, frequency, shadow energy, stability) is
derived from that one definition.

Sources: Hairer, Lubich & Wanner, Geometric Numerical Integration (2006), chapters I, II and VI, for
the splittings and the shadow energies; Butcher, Numerical Methods for Ordinary Differential Equations
(2016) for the tableaux; Ruth, IEEE Trans. Nucl. Sci. 30 (1983) 2669; Forest & Ruth, Physica D 43
(1990) 105; Yoshida, Phys. Lett. A 150 (1990) 262.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, Literal, TypeAlias

import numpy as np

from springcheck import mechanics
from springcheck.model import Extended, Floats, Force, Integers, Reals, Scene

Coefficient: TypeAlias = Fraction | str
Stage: TypeAlias = tuple[Literal["kick", "drift", "pull", "friction", "slow", "fast"], Coefficient]
"""What is done for a fraction of the step: a kick by all forces at the present q and p, a drift, a pull
by the forces of the potential alone, the exact decay of p by friction alone, or a kick by the slow or
by the fast springs alone."""

ONE, HALF = Fraction(1), Fraction(1, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scheme:
    """One-step map of a method: a splitting (`stages`), a tableau (`a`, `b`), or neither.

    `limit` is the largest h w at which the step is bounded on a spring: 0 never, infinity always.
    A scheme with neither stages nor tableau has no step: an adaptive solver, or the exact flow (`flow`),
    which has a matrix on linear scenes and nothing else.
    """

    name: str
    title: str
    order: int
    limit: float
    symplectic: bool
    stages: tuple[Stage, ...] = ()
    a: tuple[tuple[Fraction, ...], ...] = ()
    b: tuple[Fraction, ...] = ()
    flow: bool = False
    source: str = ""

    @property
    def implicit(self) -> bool:
        """Whether a step solves an equation."""
        return any(x for i, row in enumerate(self.a) for x in row[i:])

    @property
    def mixes(self) -> bool:
        """Whether slow and fast springs act at different times, so that no normal mode stays by itself."""
        return any(kind in ("slow", "fast") for kind, _ in self.stages)

    @property
    def reach(self) -> int:
        """How far a force gets within its step: 0 to the momentum, 1 to the position, 2 to a later force."""
        reach, kicked = 0, False
        for kind, _ in self.stages:
            if kind == "drift":
                reach = max(reach, int(kicked))
            elif kind != "friction":
                reach, kicked = 2 if reach else 0, True
        uses = np.array(self.a, dtype=np.float64)
        # a stage takes its position from velocities, and these from the forces of stages before
        return reach if self.stages else 2 if np.any(uses @ uses) else int(np.any(uses))

    @property
    def one_step(self) -> bool:
        """Whether `step` can carry the scheme out."""
        return bool(self.stages or self.b)


def _mirrored(*half: Stage) -> tuple[Stage, ...]:
    return (*half, *reversed(half[:-1]))


# The cube root of 2 makes Forest-Ruth's and Yoshida's fourth-order coefficients irrational:
# x1 = 1/(2 - 2**(1/3)), x0 = 1 - 2 x1; kicks and drifts are x1/2, (x0 + x1)/2, x1 and x0.
_X1 = "1.351207191959657634047687808971460826922"
_X0 = "-1.702414383919315268095375617942921653844"
_HALF_X1 = "0.675603595979828817023843904485730413461"
_HALF_X0_X1 = "-0.175603595979828817023843904485730413461"


_EIGHT: tuple[Stage, ...] = 8 * _mirrored(("fast", Fraction(1, 16)), ("drift", Fraction(1, 8)))


def _row(*numbers: int | Fraction) -> tuple[Fraction, ...]:
    return tuple(Fraction(x) for x in numbers)


_ALL = (
    Scheme(
        name="explicit-euler",
        title="explicit Euler",
        order=1,
        limit=0.0,
        symplectic=False,
        a=(_row(0),),
        b=_row(1),
        source="Euler 1768",
    ),
    Scheme(
        name="semi-implicit-euler",
        title="semi-implicit Euler, kick-drift",
        order=1,
        limit=2.0,
        symplectic=True,
        stages=(("kick", ONE), ("drift", ONE)),
        source="Hairer, Lubich & Wanner, I.1.2; the blog's own",
    ),
    Scheme(
        name="semi-implicit-euler-drift-kick",
        title="semi-implicit Euler, drift-kick",
        order=1,
        limit=2.0,
        symplectic=True,
        stages=(("drift", ONE), ("kick", ONE)),
        source="Hairer, Lubich & Wanner, I.1.2",
    ),
    Scheme(
        name="implicit-euler",
        title="implicit Euler",
        order=1,
        limit=np.inf,
        symplectic=False,
        a=(_row(1),),
        b=_row(1),
        source="Hairer, Lubich & Wanner, I.1.2",
    ),
    Scheme(
        name="velocity-verlet",
        title="velocity Verlet",
        order=2,
        limit=2.0,
        symplectic=True,
        stages=_mirrored(("kick", HALF), ("drift", ONE)),
        source="Swope et al., J. Chem. Phys. 76 (1982) 637",
    ),
    Scheme(
        name="position-verlet",
        title="position Verlet",
        order=2,
        limit=2.0,
        symplectic=True,
        stages=_mirrored(("drift", HALF), ("kick", ONE)),
        source="Tuckerman, Berne & Martyna, J. Chem. Phys. 97 (1992) 1990",
    ),
    Scheme(
        name="implicit-midpoint",
        title="implicit midpoint",
        order=2,
        limit=np.inf,
        symplectic=True,
        a=((HALF,),),
        b=_row(1),
        source="Hairer, Lubich & Wanner, I.1.2",
    ),
    Scheme(
        name="trapezoidal",
        title="trapezoidal rule (Newmark average acceleration)",
        order=2,
        limit=np.inf,
        symplectic=False,
        a=(_row(0, 0), _row(HALF, HALF)),
        b=_row(HALF, HALF),
        source="Newmark, J. Eng. Mech. Div. 85 (1959) 67, beta 1/4, gamma 1/2",
    ),
    Scheme(
        name="rk2-midpoint",
        title="explicit midpoint (RK2)",
        order=2,
        limit=0.0,
        symplectic=False,
        a=(_row(0, 0), _row(HALF, 0)),
        b=_row(0, 1),
        source="Runge 1895",
    ),
    Scheme(
        name="rk2-heun",
        title="Heun (RK2)",
        order=2,
        limit=0.0,
        symplectic=False,
        a=(_row(0, 0), _row(1, 0)),
        b=_row(HALF, HALF),
        source="Heun 1900",
    ),
    Scheme(
        name="rk4",
        title="classical Runge-Kutta (RK4)",
        order=4,
        limit=float(np.sqrt(8.0)),
        symplectic=False,
        a=(_row(0, 0, 0, 0), _row(HALF, 0, 0, 0), _row(0, HALF, 0, 0), _row(0, 0, 1, 0)),
        b=_row(Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6)),
        source="Kutta 1901",
    ),
    Scheme(
        name="ruth3",
        title="Ruth, third order",
        order=3,
        limit=2.507481170952355,
        symplectic=True,
        stages=(
            ("kick", Fraction(7, 24)),
            ("drift", Fraction(2, 3)),
            ("kick", Fraction(3, 4)),
            ("drift", Fraction(-2, 3)),
            ("kick", Fraction(-1, 24)),
            ("drift", ONE),
        ),
        source="Ruth 1983",
    ),
    Scheme(
        name="forest-ruth",
        title="Forest-Ruth, fourth order, drift first",
        order=4,
        limit=1.5734019474345401,
        symplectic=True,
        stages=_mirrored(("drift", _HALF_X1), ("kick", _X1), ("drift", _HALF_X0_X1), ("kick", _X0)),
        source="Forest & Ruth 1990",
    ),
    Scheme(
        name="yoshida4",
        title="Yoshida, fourth order, kick first",
        order=4,
        limit=1.5734019474345401,
        symplectic=True,
        stages=_mirrored(("kick", _HALF_X1), ("drift", _X1), ("kick", _HALF_X0_X1), ("drift", _X0)),
        source="Yoshida 1990",
    ),
    Scheme(
        name="langevin-middle",
        title="Langevin middle scheme at T = 0: half pull, half drift, friction, half drift, half pull",
        order=2,
        limit=2.0,
        symplectic=True,
        stages=_mirrored(("pull", HALF), ("drift", HALF), ("friction", ONE)),
        source="Leimkuhler & Matthews, Appl. Math. Res. Express 2013, 34; Zhang et al., "
        "J. Phys. Chem. A 123 (2019) 6056",
    ),
    Scheme(
        name="respa8",
        title="r-RESPA: velocity Verlet of the slow springs around 8 of the fast ones",
        order=2,
        limit=16.0,
        symplectic=True,
        stages=(("slow", HALF), *_EIGHT, ("slow", HALF)),
        source="Tuckerman, Berne & Martyna, J. Chem. Phys. 97 (1992) 1990; the limit is that of a fast "
        "spring alone, in company it resonates from h w = 16 sin(pi/16) on",
    ),
    Scheme(
        name="langevin-middle-early",
        title="Langevin middle at T = 0, momenta half a step early: pull, half drift, friction, half drift",
        order=1,
        limit=2.0,
        symplectic=True,
        stages=(("pull", ONE), ("drift", HALF), ("friction", ONE), ("drift", HALF)),
        source="Zhang et al., J. Phys. Chem. A 123 (2019) 6056; as OpenMM's integrator stores it",
    ),
    Scheme(
        name="exact",
        title="exact flow",
        order=0,
        limit=np.inf,
        symplectic=True,
        flow=True,
        source="the solution of the equation of motion",
    ),
    Scheme(
        name="adams",
        title="CVODE Adams-Moulton, orders 1-12",
        order=0,
        limit=np.inf,
        symplectic=False,
        source="Hindmarsh et al., ACM TOMS 31 (2005) 363",
    ),
    Scheme(
        name="bdf",
        title="CVODE BDF, orders 1-5",
        order=0,
        limit=np.inf,
        symplectic=False,
        source="Hindmarsh et al., ACM TOMS 31 (2005) 363",
    ),
    Scheme(
        name="ida",
        title="IDA BDF, orders 1-5, of a circuit's equations",
        order=0,
        limit=np.inf,
        symplectic=False,
        source="Hindmarsh et al., ACM TOMS 31 (2005) 363",
    ),
)

SCHEMES: dict[str, Scheme] = {scheme.name: scheme for scheme in _ALL}


def number(c: Coefficient, width: type[Any]) -> Any:
    """A coefficient rounded once to a float of this width (np.float64, np.longdouble)."""
    return width(c.numerator) / width(c.denominator) if isinstance(c, Fraction) else width(c)


def _sum(terms: list[tuple[Any, Reals]], start: Reals) -> Reals:
    for c, x in terms:
        if c:
            start = start + c * x
    return start


def step(
    scheme: Scheme,
    q: Reals,
    p: Reals,
    *,
    h: Any,
    m: Reals,
    force: Force,
    stiffness: Reals | None = None,
    rate: Reals | None = None,
    parts: tuple[Force, Force] | None = None,
) -> tuple[Reals, Reals]:
    """One step from (q, p), each (..., n), in the width of q.

    Implicit schemes need `stiffness`, the second derivatives of the potential: (n, n), or (n,) where no
    particle is joined to another; double precision is enough, because it only steers an iteration whose
    residual has the full width.  `rate` is `mechanics.rates`, left out where nothing is damped; `parts`
    are the forces of the slow and the fast springs, for the schemes that part them.
    """
    width = q.dtype.type
    h, m = width(h), m.astype(width)
    if scheme.stages:
        for kind, c in scheme.stages:
            ch = number(c, width) * h
            if kind == "drift":
                q = q + ch * (p / m)
            elif kind == "friction":
                p = p if rate is None else p * np.exp(-ch * rate.astype(width))
            else:
                p = p + ch * _acting(kind, force, parts)(q, p)
        return q, p
    if not scheme.b:
        raise ValueError(f"{scheme.name} has no step that a force alone defines")
    forces: list[Reals] = []
    velocities: list[Reals] = []
    for row in scheme.a:
        past = [number(c, width) * h for c in row[: len(forces)]]
        qs = _sum(list(zip(past, velocities, strict=True)), q)
        ps = _sum(list(zip(past, forces, strict=True)), p)
        own = row[len(forces)]
        if own:
            if stiffness is None:
                raise ValueError(f"{scheme.name} needs the stiffness of the scene")
            qs, ps = _implicit_stage(qs, ps, number(own, width) * h, m, force, stiffness, rate)
        forces.append(force(qs, ps))
        velocities.append(ps / m)
    weights = [number(c, width) * h for c in scheme.b]
    return (
        _sum(list(zip(weights, velocities, strict=True)), q),
        _sum(list(zip(weights, forces, strict=True)), p),
    )


def _acting(kind: str, force: Force, parts: tuple[Force, Force] | None) -> Force:
    """The force behind a stage."""
    if kind == "kick":
        return force
    if kind == "pull":
        return lambda q, p: force(q, np.zeros_like(p))
    if parts is None:
        raise ValueError("this scheme needs the slow and the fast force apart")
    return parts[kind == "fast"]


@lru_cache(maxsize=2)
def _inverse(matrix: bytes, n: int) -> Floats:
    """The inverse of a matrix (n, n), found once for all steps of a run."""
    return np.asarray(np.linalg.inv(np.frombuffer(matrix).reshape(n, n)))


def _implicit_stage(
    q: Reals, p: Reals, x: Any, m: Reals, force: Force, stiffness: Reals, rate: Reals | None
) -> tuple[Reals, Reals]:
    """Solve Q = q + x P/m, P = p + x F(Q, P) by Newton's iteration on Q.

    Friction is linear in P: P (1 + x rate) = p + x F(Q, 0), so it needs no iteration of its own.
    """
    none = np.zeros_like(p)
    slowed = 1 if rate is None else 1 + x * rate.astype(q.dtype)
    factor = x * x / (m * slowed)
    diagonal = stiffness.ndim == 1
    if diagonal:
        matrix = 1 + np.asarray(stiffness, q.dtype) * factor
    else:
        matrix = np.eye(len(m)) + np.asarray(stiffness, np.float64) * factor.astype(np.float64)[:, None]
        # it only steers: what counts is the residual
        inverse = _inverse(np.ascontiguousarray(matrix).tobytes(), len(m)).T
    guess, last = q, np.inf
    for _ in range(50):
        residual = guess - q - x * ((p + x * force(guess, none)) / slowed) / m
        change = residual / matrix if diagonal else residual.astype(np.float64) @ inverse
        guess = guess - change
        eps = np.finfo(q.dtype).eps
        if not np.any(np.abs(change) > eps * np.abs(guess)):
            break
        # a component near 0 never gets there; where all are at their last digits nothing shrinks any more
        size = np.max(np.abs(change))
        if last / 2 <= size <= 1e3 * eps * np.max(np.abs(guess)):
            break
        last = size
    return guess, np.asarray((p + x * force(guess, none)) / slowed)


def magnitude_step(
    scheme: Scheme,
    q: Reals,
    p: Reals,
    *,
    h: float,
    m: Reals,
    magnitude: Force,
    stiffness: Reals | None = None,
    rate: Reals | None = None,
    parts: tuple[Force, Force] | None = None,
    kicks: Sequence[Force] = (),
) -> tuple[Reals, Reals]:
    """What bounds the rounding of `step`: the same step with every difference taken as a sum.

    `magnitude` and `parts` are made by `mechanics.magnitude`; `kicks` are one for each kick of a splitting,
    near where it takes place, and stand for `magnitude` where they are given.  An implicit scheme's is
    carried through the solution of its equation.
    """
    direction = np.sign(h)
    # in extended precision: the square of a step may leave the range of a double
    q, p, size = np.abs(q), np.abs(p), np.abs(np.longdouble(h))
    if scheme.stages:
        stages: list[tuple[str, float]] = [(kind, abs(number(c, np.float64))) for kind, c in scheme.stages]
        each = iter(kicks)
        for kind, c in stages:
            if kind == "drift":
                q = q + c * size * p / m
            elif kind == "friction":
                # a rounding of x in exp(-x) costs x exp(-x) p, and the decayed p is exp(-x) p: the sum is
                # below p forwards in time; backwards p grows first
                x = np.zeros_like(m) if rate is None else -c * direction * size * rate
                p = p * np.where(x > 0, (1 + x) * np.exp(x), 1)
            else:
                p = p + c * size * next(each, _acting(kind, magnitude, parts))(q, p)
        return q, p
    rows = [[abs(float(c)) * size for c in row] for row in scheme.a]
    forces: list[Reals] = []
    velocities: list[Reals] = []
    for row in rows:
        qs = _sum(list(zip(row, velocities, strict=False)), q)
        ps = _sum(list(zip(row, forces, strict=False)), p)
        own = row[len(forces)]
        if own:
            slowed = np.ones_like(m) if rate is None else np.abs(1 + direction * own * rate)
            kicked = (ps + own * magnitude(qs, np.zeros_like(ps))) / slowed
            qs = _solved(qs + own * kicked / m, own**2 / (m * slowed), stiffness)
            ps = (ps + own * magnitude(qs, np.zeros_like(ps))) / slowed
        forces.append(magnitude(qs, ps))
        velocities.append(ps / m)
    weights = [abs(float(c)) * size for c in scheme.b]
    return (
        _sum(list(zip(weights, velocities, strict=True)), q),
        _sum(list(zip(weights, forces, strict=True)), p),
    )


def _solved(given: Reals, factor: Reals, stiffness: Reals | None) -> Reals:
    """What bounds the rounding of the solution of (1 + factor * stiffness) x = b, `given` bounding b.

    Componentwise backward error: |A^-1| (|A| |x| + |b|) with |x| <= |A^-1| |b| (Higham, Accuracy and
    Stability of Numerical Algorithms, 7.2).
    """
    if stiffness is None:
        return given
    if stiffness.ndim == 1:
        change = factor * stiffness
        inverse = 1 / np.abs(1 + change)
        return np.asarray(((1 + np.abs(change)) * (inverse * given) + given) * inverse)
    matrix = np.asarray(factor, np.float64)[:, None] * np.asarray(stiffness, np.float64)
    inverse = np.abs(np.linalg.inv(np.eye(len(matrix)) + matrix)).T
    return np.asarray(((given @ inverse) @ (np.eye(len(matrix)) + np.abs(matrix)).T + given) @ inverse)


def roundings(scheme: Scheme) -> int:
    """Roundings on the longest path through one step: a force 4, a kick 2, a drift 3, in and out 4.

    Friction takes 3: its exponent, the exponential and the product.
    """
    if scheme.stages:
        return 4 + sum(3 if kind in ("drift", "friction") else 6 for kind, _ in scheme.stages)
    return 4 + sum(6 + 3 + 2 * len(row) for row in scheme.a) + 2 * len(scheme.b)


def matrix(scheme: Scheme, *, h: float, m: Reals, k: Reals, c: Reals | float = 0.0) -> Extended:
    """One-step matrices on (q, p) of springs m, k (n,), each with friction c -> (n, 2, 2), extended.

    Found by stepping the two unit vectors, so the scheme is written down once.  A scheme that parts slow
    from fast takes each spring for a fast one; the exact flow is the exponential.
    """
    m, k, friction = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, np.longdouble)) for x in (m, k, c)))
    if scheme.flow:
        return _exponential(m, k, friction, h)

    def force(q: Reals, p: Reals) -> Reals:
        return np.asarray(-k * q - friction * (p / m))

    def none(q: Reals, p: Reals) -> Reals:
        return np.zeros_like(q)

    out = np.empty((len(m), 2, 2), dtype=np.longdouble)
    ones, zeros = np.ones(len(m), dtype=np.longdouble), np.zeros(len(m), dtype=np.longdouble)
    q, p = step(
        scheme,
        np.stack([ones, zeros]),
        np.stack([zeros, ones]),
        h=h,
        m=m,
        force=force,
        stiffness=k,
        rate=friction / m if np.any(friction) else None,
        parts=(none, force),
    )
    out[:, 0, :], out[:, 1, :] = q.T, p.T
    return out


def _exponential(m: Extended, k: Extended, c: Extended, h: float) -> Extended:
    """The exact flow (n, 2, 2), of any damping: of exp(h L) with L = N - g I, N**2 is a multiple of I."""
    eye = np.eye(2, dtype=np.longdouble)
    t = np.longdouble(h)
    generator = np.zeros((len(m), 2, 2), dtype=np.longdouble)
    generator[:, 0, 1], generator[:, 1, 0], generator[:, 1, 1] = 1 / m, -k, -c / m
    g = -(generator[:, 0, 0] + generator[:, 1, 1]) / 2
    traceless = generator + g[:, None, None] * eye
    w2 = traceless[:, 0, 0] * traceless[:, 1, 1] - traceless[:, 0, 1] * traceless[:, 1, 0]
    w = np.sqrt(np.abs(w2))
    safe = np.where(w == 0, 1, w)
    even = np.where(w2 >= 0, np.cos(w * t), np.cosh(np.where(w2 < 0, w, 0) * t))
    odd = np.where(w2 >= 0, np.sin(w * t), np.sinh(np.where(w2 < 0, w, 0) * t)) / safe
    odd = np.where(w == 0, t, odd)
    decay = np.exp(-g * t)
    return np.asarray((decay * even)[:, None, None] * eye + (decay * odd)[:, None, None] * traceless)


def propagator(scheme: Scheme, scene: Scene, *, h: float) -> Extended:
    """One-step matrix (2n, 2n) on (q - q*, p - p*) of a linear scene, q* and p* a state that stays.

    Found by stepping the unit vectors and taking off what the state 0 becomes; it serves scenes whose
    modes a scheme mixes.
    """
    n = scene.n
    z = np.concatenate([np.zeros((1, 2 * n)), np.eye(2 * n)]).astype(np.longdouble)
    slow, fast = mechanics.split(scene.terms)
    q, p = step(
        scheme,
        z[:, :n],
        z[:, n:],
        h=h,
        m=scene.m.astype(np.longdouble),
        force=mechanics.force(scene.terms),
        stiffness=mechanics.stiffness(scene, scene.q) if scheme.implicit else None,
        rate=mechanics.rates(scene),
        parts=(mechanics.force(slow), mechanics.force(fast)),
    )
    after = np.concatenate([q, p], axis=1)
    return np.asarray((after[1:] - after[0]).T, np.longdouble)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rotation:
    """The powers of one-step matrices of determinant d: M**j = d**(j/2) (C I + S (M/sqrt(d) - cos(angle) I)).

    With `angle` the phase of one step, C = cos(j angle) and S = sin(j angle)/sin(angle); hyperbolic where
    the motion is unbounded (`growth` > 0 then, and `sign` the sign of the eigenvalues), linear between.
    """

    determinant: Extended
    angle: Extended
    growth: Extended
    sign: Extended


def rotation(matrices: Extended) -> Rotation:
    """Phase and growth of one-step matrices (n, 2, 2), without the cancellation of acos(trace/2).

    Where the determinant is not positive a step turns area over and has neither.
    """
    a, b = matrices[:, 0, 0], matrices[:, 0, 1]
    c, d = matrices[:, 1, 0], matrices[:, 1, 1]
    determinant = a * d - b * c
    # -discriminant/4 = det sin(angle)**2; b*c is -(h w)**2 to leading order, so nothing cancels
    minus = -((a - d) ** 2 / 4 + b * c)
    half_trace = (a + d) / 2
    root = np.sqrt(np.abs(minus))
    turning = minus > 0
    angle = np.where(turning, np.arctan2(root, half_trace), 0)
    # where area is turned over (determinant <= 0) there is no such growth
    hyperbolic = (minus < 0) & (determinant > 0)
    growth = np.where(hyperbolic, np.arcsinh(root / np.sqrt(np.where(hyperbolic, determinant, 1))), 0)
    return Rotation(
        determinant=determinant,
        angle=angle,
        growth=growth,
        sign=np.where(half_trace < 0, np.longdouble(-1), np.longdouble(1)),
    )


def invariant(matrices: Extended, *, h: float) -> Extended:
    """Coefficients (n, 3) of the quadratic form s_qq q**2 + s_qp q p + s_pp p**2 that a step multiplies
    by the determinant of its matrix: the shadow energy, equal to H up to order h [M L2/T2].

    For every 2 x 2 matrix, M21 q**2 + (M22 - M11) q p - M12 p**2 has that property; -1/2h scales it to H.
    """
    out = np.stack([matrices[:, 1, 0], matrices[:, 1, 1] - matrices[:, 0, 0], -matrices[:, 0, 1]], axis=-1)
    return np.asarray(out / np.longdouble(-2 * np.longdouble(h)))


def propagate(
    matrices: Extended, y: Extended, v: Extended, steps: Integers, *, area_preserving: bool
) -> tuple[Extended, Extended]:
    """Closed form of the discrete motion: M**j (y, v) of n modes for j in steps (f,) -> (f, n), twice.

    M**j = d**(j/2) (C + S (M/sqrt(d) - c)) with d the determinant, c = cos(angle), C = cos(j angle) and
    S = sin(j angle)/sin(angle); hyperbolic where the eigenvalues are real, j at the edge between.
    """
    turn = rotation(matrices)
    j = np.asarray(steps).astype(np.longdouble)[:, None]
    d = np.ones_like(turn.determinant) if area_preserving else turn.determinant
    if np.any(d <= 0):
        raise ValueError("a step that turns area over has no phase")
    sign = np.where(np.asarray(steps)[:, None] % 2 == 1, turn.sign, 1)
    x, g = turn.angle, turn.growth
    one = np.ones_like(x)
    with np.errstate(over="ignore", invalid="ignore"):
        turning, growing = x != 0, g != 0
        near = np.where(turning, np.cos(x), np.where(growing, turn.sign * np.cosh(g), turn.sign * one))
        even = np.where(turning, np.cos(j * x), np.where(growing, sign * np.cosh(j * g), sign))
        sine = np.where(turning, np.sin(np.where(turning, x, 1)), np.sinh(np.where(growing, g, 1)))
        odd = np.where(
            turning,
            np.sin(j * x) / sine,
            np.where(growing, sign * turn.sign * np.sinh(j * g) / sine, sign * turn.sign * j),
        )
        root = np.sqrt(d)
        # d is 1 + (h w)**2 or the like: the logarithm of the rounded sum would be wrong by j EPS
        less = matrices - np.eye(2, dtype=np.longdouble)
        a, c = less[:, 0, 0], less[:, 1, 1]
        beyond = a + c + a * c - less[:, 0, 1] * less[:, 1, 0]
        size = np.exp(j / 2 * (np.zeros_like(d) if area_preserving else np.log1p(beyond)))
        a, b = matrices[:, 0, 0] / root - near, matrices[:, 0, 1] / root
        c, e = matrices[:, 1, 0] / root, matrices[:, 1, 1] / root - near
        return (
            np.asarray(size * (even * y + odd * (a * y + b * v))),
            np.asarray(size * (even * v + odd * (c * y + e * v))),
        )


def condition(matrices: Extended, w: Extended) -> Extended:
    """How far the invariant ellipses of one-step matrices (n, 2, 2) are from circles: the ratio of their
    axes in energy coordinates (w y, v), w (n,) > 0.  No power of a map is larger than that, whatever its
    determinant makes of it; infinite where the motion does not turn.
    """
    a, b = matrices[:, 0, 0], matrices[:, 0, 1] * w
    c, d = matrices[:, 1, 0] / w, matrices[:, 1, 1]
    half = np.abs(c - b) / 2
    area = -((a - d) ** 2 / 4 + b * c)
    turning = area > 0
    spread = np.sqrt(np.maximum(half**2 - area, 0))
    return np.asarray(np.where(turning, (half + spread) / np.sqrt(np.where(turning, area, 1)), np.inf))


def amplification(matrices: Extended, w: Extended, steps: Integers) -> tuple[Floats, Floats]:
    """How much j steps can enlarge one rounding a step: (sum over i < j of |M**i| / r**i, r**j).

    r >= 1 is the spectral radius.  Norms are taken in energy coordinates (w y, v), w (n,) > 0, and the
    worst mode counts; (f,) each.  At the edge of stability |M**i| grows with i, and the sum with j**2.
    """
    turn = rotation(matrices)
    half = (matrices[:, 0, 0] + matrices[:, 1, 1]) / 2
    split = np.sqrt(np.maximum(half * half - turn.determinant, 0))
    larger = half + np.where(half < 0, -split, split)
    # where area turns over or vanishes the eigenvalues are real and of unlike sign: powers are bounded by
    # the larger one, x**i (1 + 2 |M - x| / |x - y|), instead of by the root of the determinant
    over = turn.determinant <= 0
    root = np.where(over, np.abs(larger), np.sqrt(np.abs(turn.determinant)))
    root = np.where(root > 0, root, 1)
    growth = np.where(over, 0, turn.growth)
    near = np.where(turn.angle != 0, np.cos(turn.angle), turn.sign * np.cosh(growth))
    near = np.where(over, larger / root, near)
    rest = np.stack(
        [
            np.stack([matrices[:, 0, 0] / root - near, w * matrices[:, 0, 1] / root], axis=-1),
            np.stack([matrices[:, 1, 0] / w / root, matrices[:, 1, 1] / root - near], axis=-1),
        ],
        axis=-2,
    )
    size = np.sqrt(np.sum(rest * rest, axis=(-2, -1)))
    sine = np.where(turn.angle != 0, np.sin(turn.angle), 2 * np.sinh(growth))
    sine = np.where(over, split / root, sine)
    longest = np.where(sine > 0, 1 / np.where(sine > 0, sine, 1), np.inf)
    radius = np.maximum(root * np.exp(growth), 1)
    j = np.asarray(steps).astype(np.longdouble)[:, None]
    short = np.minimum(j, longest)
    with np.errstate(over="ignore", invalid="ignore"):
        ramp = short * (short - 1) / 2 + np.where(j > short, (j - short) * short, 0)
        total = np.max(np.minimum(j + size * np.maximum(ramp, 0), j * condition(matrices, w)), axis=-1)
        grown = np.max(radius**j, axis=-1)
    return np.asarray(total, np.float64), np.asarray(grown, np.longdouble)
