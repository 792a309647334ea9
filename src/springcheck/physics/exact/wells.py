"""Closed forms of single particles in a well, and of pairs on a bond.

Each serves particles that nothing joins to others, all at once, at times t (f, 1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from springcheck.arrays import Extended
from springcheck.physics.exact.elliptic import argument, jacobi
from springcheck.physics.terms import Cosine, Morse, Quartic, WallSpring

if TYPE_CHECKING:
    from springcheck.physics.scene import Scene

States = tuple[Extended, Extended]
PI = 4 * np.arctan(np.longdouble(1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Well:
    """A closed form: for particles on which a term `key` acts, and nothing but `terms`."""

    key: str
    terms: frozenset[str]
    is_known: Callable[[Scene], bool]
    motion: Callable[[Scene, Extended], States]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Duffing:
    """u'' = -k u - b u**3 of unit masses (k, b per mass), all (n,); E is the energy of the start.

    root = sqrt(k**2 + 4 b E) = k + b A**2 at a turning point A; minus = root - k; plus = root + k.
    """

    k: Extended
    b: Extended
    u: Extended
    v: Extended
    root: Extended
    minus: Extended
    plus: Extended

    def __getitem__(self, which: NDArray[np.bool_]) -> _Duffing:
        return _Duffing(**{name: getattr(self, name)[which] for name in self.__slots__})


def _duffing(scene: Scene) -> tuple[_Duffing, Extended] | None:
    """The wells and their centres, or None where one has several centres, or no turning point."""
    k, b, at = np.zeros((3, scene.n), dtype=np.longdouble)
    for term in scene.terms:
        if isinstance(term, Quartic):
            np.add.at(b, term.i, term.b)
            at[term.i] = term.at
        elif isinstance(term, WallSpring):
            np.add.at(k, term.i, term.k)
    for term in scene.terms:
        if isinstance(term, Quartic | WallSpring) and np.any(term.at != at[term.i]):
            return None
    m = scene.m.astype(np.longdouble)
    k, b, u, v = k / m, b / m, scene.q - at, scene.p / m
    square = (k + b * u * u) ** 2 + 2 * b * v * v
    inside = (k > 0) & (square >= 0) & (k + b * u * u >= 0)
    if not np.all((b > 0) | inside):
        return None
    root = np.sqrt(square)
    gain = b * (2 * v * v + (2 * k + b * u * u) * u * u)
    # root**2 - k**2 is 4 b E, so that of plus and minus the one that cancels follows from the other
    large = root + np.abs(k)
    small = gain / np.where(large > 0, large, 1)
    minus, plus = np.where(k < 0, large, small), np.where(k < 0, small, large)
    return _Duffing(k=k, b=b, u=u, v=v, root=root, minus=minus, plus=plus), at


def _has_turning_points(scene: Scene) -> bool:
    return _duffing(scene) is not None


def _stiffening(scene: Scene, t: Extended) -> States:
    """Byrd & Friedman, Handbook of Elliptic Integrals (1971): cn, dn or sn, by what holds the particle."""
    found = _duffing(scene)
    if found is None:
        raise ValueError(f"scene {scene.name!r}: a particle has several centres, or no turning point")
    well, at = found
    u, v = np.empty((2, len(t), scene.n), dtype=np.longdouble)
    softening = well.b <= 0
    # the sign of the energy: beside |k| it may be lost in the root
    caught = ~softening & (well.plus < 0)
    for which, law in ((softening, _sn), (caught, _dn), (~softening & ~caught, _cn)):
        if np.any(which):
            u[:, which], v[:, which] = law(well[which], t)
    return u + at, v * scene.m


def _cn(well: _Duffing, t: Extended) -> States:
    """Across the middle of a stiffening well: u = A cn(W t + phase), W**2 = root."""
    rest = well.root == 0
    root = np.where(rest, 1, well.root)
    m, m1 = np.where(rest, 0, well.minus / (2 * root)), np.where(rest, 1, well.plus / (2 * root))
    amplitude, w = np.sqrt(well.minus / well.b), np.sqrt(well.root)
    cosine = well.u / np.where(amplitude > 0, amplitude, 1)
    turn = np.sqrt(root * (m1 + m * cosine * cosine))
    # on the top of the barrier nothing turns: it is reached after an infinite time
    sine = np.where(turn > 0, -well.v / np.where(turn > 0, turn, 1), 1)
    at = jacobi(t * w + argument(sine, well.u, m, m1), m, m1)
    return np.asarray(amplitude * at.cn), np.asarray(-amplitude * w * at.sn * at.dn)


def _dn(well: _Duffing, t: Extended) -> States:
    """Caught in one of two wells: u = +-A dn(W t + phase), W**2 = (root - k)/2."""
    m, m1 = 2 * well.root / well.minus, -well.plus / well.minus
    amplitude, w = np.copysign(np.sqrt(well.minus / well.b), well.u), np.sqrt(well.minus / 2)
    # of twice am(phase) sine and cosine are rational in the start
    y, x = -np.copysign(np.sqrt(2 * well.b) * well.v, well.u * well.v), well.k + well.b * well.u**2
    # half of that angle, without the angle: what is small of the two follows from the other
    large = np.sqrt((well.root + np.abs(x)) / 2)
    small = np.abs(y) / (2 * np.where(large > 0, large, 1))
    sine, cosine = np.where(x < 0, large, small), np.where(x < 0, small, large)
    at = jacobi(t * w + argument(np.copysign(sine, y), cosine, m, m1), m, m1)
    return np.asarray(amplitude * at.dn), np.asarray(-amplitude * w * m * at.sn * at.cn)


def _sn(well: _Duffing, t: Extended) -> States:
    """Below the barriers of a softening spring: u = A sn(W t + phase), W**2 = (k + root)/2."""
    m, m1 = -well.minus / well.plus, 2 * well.root / well.plus
    w = np.sqrt(well.plus / 2)
    # A**2 = 4 E / plus, a sum where minus / b would be a quotient of small numbers
    amplitude = np.sqrt((2 * well.v**2 + (2 * well.k + well.b * well.u**2) * well.u**2) / well.plus)
    dn = np.sqrt((well.root + well.k + well.b * well.u**2) / well.plus)
    at = jacobi(t * w + argument(well.u, well.v / (w * np.where(dn > 0, dn, 1)), m, m1), m, m1)
    return np.asarray(amplitude * at.sn), np.asarray(amplitude * w * at.cn * at.dn)


def _one_each(scene: Scene) -> bool:
    """Whether one term alone acts on each particle."""
    return bool(np.all(scene.system.pulls == 1))


def _swings(scene: Scene) -> bool:
    return _one_each(scene) and all(np.all(t.depth != 0) for t in scene.terms if isinstance(t, Cosine))


def _pendulum(scene: Scene, t: Extended) -> States:
    """Libration, sin(angle/2) = R sn(w t + phase | R**2), and rotation, angle/2 = am(R w t + phase | 1/R**2).

    R**2 = E / 2 depth, w**2 = depth wave**2 / mass; Landau & Lifshitz, Mechanics, section 11.
    """
    q, p = np.empty((2, len(t), scene.n), dtype=np.longdouble)
    for term in scene.terms:
        assert isinstance(term, Cosine)
        i, length = term.i, 1 / term.wave.astype(np.longdouble)
        mass = scene.m[i].astype(np.longdouble)
        # upside down, the pendulum hangs from the other side
        at = term.at + np.where(term.depth < 0, PI * length, 0)
        w = np.sqrt(np.abs(term.depth) / mass) / length
        angle, rate = (scene.q[i] - at) / length, scene.p[i] / (mass * length)
        turns = np.round(angle / (2 * PI))
        half = (angle - 2 * PI * turns) / 2
        a, r = _swing(half, rate / (2 * w), w, t)
        q[:, i], p[:, i] = at + length * (2 * (a + PI * turns)), mass * length * 2 * w * r
    return q, p


def _swing(half: Extended, r: Extended, w: Extended, t: Extended) -> States:
    """Half the angle, and its rate in units of w, at times t; r is the rate of the start in these units."""
    s, c = np.sin(half), np.cos(half)
    m, m1 = s * s + r * r, (c - r) * (c + r)
    over = m1 < 0
    # over the top the modulus is 1/m, and the arguments run sqrt(m) times as fast
    fast = np.where(over, np.sqrt(m), 1)
    safe = np.where(m > 0, m, 1)
    modulus, other = np.where(over, 1 / safe, m), np.where(over, -m1 / safe, m1)
    phase = argument(np.where(over, np.sign(r) * s, s), np.where(over, c, r), modulus, other)
    at = jacobi(w * t * fast + phase, modulus, other)
    root = np.sqrt(m)
    swing = np.arctan2(root * at.sn, at.dn)
    return (
        np.asarray(np.where(over, np.sign(r) * at.am, swing)),
        np.asarray(np.where(over, np.sign(r) * root * at.dn, root * at.cn)),
    )


def _is_bond(scene: Scene) -> bool:
    """One bond each that pulls together, and not at the very edge of dissociation."""
    if not _one_each(scene):
        return False
    terms = [t for t in scene.terms if isinstance(t, Morse)]
    return all(np.all((t.depth > 0) & (t.steepness != 0) & (_bond(scene, t).excess != 0)) for t in terms)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Bond:
    """Relative motion of each bond: reduced mass, elongation, relative momentum, E / depth, and that less 1.

    Near the bottom of the well the one is small, near dissociation the other: neither follows from the other.
    """

    mass: Extended
    u: Extended
    p: Extended
    share: Extended
    """m_a / (m_a + m_b)."""
    energy: Extended
    excess: Extended


def _bond(scene: Scene, term: Morse) -> _Bond:
    ma, mb = (scene.m[end].astype(np.longdouble) for end in (term.a, term.b))
    total = ma + mb
    u: Extended = np.asarray(scene.q[term.b].astype(np.longdouble) - scene.q[term.a] - term.rest)
    p = (ma * scene.p[term.b] - mb * scene.p[term.a]) / total
    mass = ma * mb / total
    x, kinetic = np.exp(-term.steepness * u), p * p / (2 * mass * term.depth)
    gap = np.expm1(-term.steepness * u)
    return _Bond(
        mass=mass, u=u, p=p, share=ma / total, energy=kinetic + gap * gap, excess=kinetic + x * (x - 2)
    )


def _morse(scene: Scene, t: Extended) -> States:
    """With s = exp(steepness u), s'' = w**2 (excess s + 1): a circular or hyperbolic function (Morse 1929).

    w**2 = 2 depth steepness**2 / mass; excess = E/depth - 1.  The centre of mass goes straight on.
    """
    q, p = np.empty((2, len(t), scene.n), dtype=np.longdouble)
    for term in scene.terms:
        assert isinstance(term, Morse)
        bond = _bond(scene, term)
        w = np.abs(term.steepness) * np.sqrt(2 * term.depth / bond.mass)
        z0 = np.expm1(term.steepness * bond.u)
        dz0 = term.steepness * bond.p / bond.mass * (1 + z0)
        rate = w * np.sqrt(np.abs(bond.excess))
        bound = bond.excess < 0
        z, dz = np.where(
            bound,
            _inside(z0, dz0, w * w * bond.energy, rate, np.where(bound, rate, 0) * t),
            _outside(dz0, bond, rate, np.where(bound, 0, rate) * t),
        )
        u, pull = np.log1p(z) / term.steepness, bond.mass * dz / (term.steepness * (1 + z))
        ma, mb = scene.m[term.a].astype(np.longdouble), scene.m[term.b].astype(np.longdouble)
        total = scene.p[term.a].astype(np.longdouble) + scene.p[term.b]
        share = bond.share
        qa, qb = scene.q[term.a].astype(np.longdouble), scene.q[term.b].astype(np.longdouble)
        centre = share * qa + (1 - share) * qb + total / (ma + mb) * t
        length = term.rest + u
        q[:, term.a], q[:, term.b] = centre - (1 - share) * length, centre + share * length
        p[:, term.a], p[:, term.b] = share * total - pull, (1 - share) * total + pull
    return q, p


def _inside(z0: Extended, dz0: Extended, pull: Extended, rate: Extended, phase: Extended) -> Extended:
    """z'' = pull - rate**2 (z + ...), z = s - 1, from its start: z and z' (2, f, n)."""
    sine = np.sin(phase)
    half = np.sin(phase / 2)
    slope = pull - rate * rate * z0
    z = z0 + slope * 2 * half * half / rate**2 + dz0 * sine / rate
    return np.stack([z, slope * sine / rate + dz0 * np.cos(phase)])


def _outside(dz0: Extended, bond: _Bond, rate: Extended, phase: Extended) -> Extended:
    """s = (root cosh(phase + start) - 1) / excess, root**2 = 1 + excess: nothing cancels on the way in.

    Nor just above dissociation, with root - 1 = excess / (root + 1) and cosh x - 1 = 2 sinh(x/2)**2.
    """
    root, excess = np.sqrt(bond.energy), bond.excess
    start = np.arcsinh(dz0 * excess / (rate * np.where(root > 0, root, 1)))
    half = np.sinh((phase + start) / 2)
    z = 2 * root * half * half / excess - root / (root + 1)
    return np.stack([z, root * rate * np.sinh(phase + start) / excess])


WELLS = (
    Well(
        key="quartic",
        terms=frozenset({"quartic", "wall-spring"}),
        is_known=_has_turning_points,
        motion=_stiffening,
    ),
    Well(key="cosine", terms=frozenset({"cosine"}), is_known=_swings, motion=_pendulum),
    Well(key="morse", terms=frozenset({"morse"}), is_known=_is_bond, motion=_morse),
)
"""The closed forms that there are.  A new one is a new entry."""
