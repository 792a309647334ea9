"""Quantities derived from a scene, each computed once: forces, curvature, energies, sizes, modes, variants.

`scene.system` is the one `System` of a scene.  Its functions take any width of float, and a trajectory as
well as one state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property, partial
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import SceneError
from springcheck.physics import graph, memory
from springcheck.physics.arrays import WIDE, Extended, Floats, Force, Integers, Reals, in_pieces
from springcheck.physics.driven import Drive, with_clock
from springcheck.physics.fields import SceneFields
from springcheck.physics.norm import SMALLEST_ENERGY, Norm, kinetic_energy
from springcheck.physics.term import Term
from springcheck.physics.terms import Damping, VanDerPol

Fields = TypeVar("Fields", bound=SceneFields)

MOST_JOINED = 256
"""Most joined particles for which normal modes are computed: their cost in extended precision grows with the
cube, 5 s here.  The modes of a uniform chain are known at any length."""

MOST_DENSE = 1024
"""Most joined particles for which second derivatives are stored as n x n numbers."""


def _most(term: Term, q: Reals) -> Reals:
    """The larger absolute curvature of each row, at q (..., n) or at rest -> (..., s) or (s,) [M/T2]."""
    return np.maximum(np.abs(term.curvature(q)), term.rigidity)


class System(Generic[Fields]):
    """The facts of one scene without its motion.  m, q, p (n,) and terms are the scene's own."""

    def __init__(self, scene: Fields) -> None:
        self.scene = scene
        self.n, self.m, self.terms = scene.n, scene.m, scene.terms
        self.q, self.p = scene.q, scene.p
        self.duration = abs(scene.step) * scene.steps

    # what kind of system it is

    @cached_property
    def is_linear(self) -> bool:
        """Whether every force is linear in q and p, so that steps are matrices."""
        return all(term.is_linear for term in self.terms)

    @cached_property
    def is_driven(self) -> bool:
        """Whether some force depends on the time."""
        return any(term.kind == "drive" for term in self.terms)

    @property
    def keeps_energy(self) -> bool:
        """Whether the exact solution conserves the energy: without friction and drives."""
        return not (self.is_damped or self.is_driven)

    @cached_property
    def clocked(self) -> Fields:
        """The scene with a clock next to its particles (see `driven`), or itself if no force depends on
        time."""
        return with_clock(self.scene) if self.is_driven else self.scene

    @cached_property
    def is_separate(self) -> bool:
        """Whether no term joins two coordinates: n independent systems side by side."""
        return all(term.bodies == 1 and term.is_by_axes for term in self.terms)

    @cached_property
    def is_damped(self) -> bool:
        """Whether any friction acts."""
        return self.brakes_by_place or bool(np.any(self.friction_rates != 0))

    @cached_property
    def brakes_by_place(self) -> bool:
        """Whether some friction depends on the position."""
        return any(isinstance(term, VanDerPol) for term in self.terms)

    @cached_property
    def has_modes(self) -> bool:
        """Whether the motion decouples into modes that can be computed: linear, and uncoupled by friction.

        Friction does not couple modes where no term joins two particles, or where it has one rate.
        """
        if not self.is_linear:
            return False
        if self.is_separate:
            return True
        return self.has_one_friction_rate and (self.n <= MOST_JOINED or self.is_uniform_chain)

    @property
    def has_one_friction_rate(self) -> bool:
        """Whether every particle has the same friction rate, to a rounding of c/m."""
        rate = self.friction_rates
        return bool(np.ptp(rate) <= 2.0**-52 * np.max(rate))

    def pulls(self, terms: Iterable[Term] | None = None) -> Integers:
        """Number of rows of these terms, or of all, on each particle (n,)."""
        return self._of_rows(lambda term: 1, np.zeros(self.n), terms).astype(np.int64)

    def _of_rows(
        self, of: Callable[[Any], Any], out: Reals, terms: Iterable[Term] | None = None
    ) -> NDArray[Any]:
        """Sum in out (..., n) of a number for each row of these terms, of(term), on each of its particles."""
        for term in self.terms if terms is None else terms:
            term.scatter(np.broadcast_to(of(term), (*out.shape[:-1], len(term))), out)
        return out

    alike = cached_property(graph.alike)
    free_groups = cached_property(graph.free_groups)
    is_uniform_chain = cached_property(graph.is_uniform_chain)
    rest_positions = cached_property(graph.rest_positions)

    # forces

    @cached_property
    def slow(self) -> tuple[Term, ...]:
        """Terms that a method of multiple time steps evaluates in its long step."""
        return tuple(term for term in self.terms if not term.fast)

    @cached_property
    def fast(self) -> tuple[Term, ...]:
        """The terms that the scene marks as fast."""
        return tuple(term for term in self.terms if term.fast)

    @cached_property
    def force(self) -> Force:
        """The force of all terms as a function of (q, p), each (..., n) -> (..., n) [M L/T2]."""
        return self.force_of(self.terms)

    @cached_property
    def potential_force(self) -> Force:
        """The force of the potential: all but friction."""
        return self.force_of(term for term in self.terms if term.kind == "potential")

    @cached_property
    def parts(self) -> tuple[Force, Force]:
        """The forces of the slow and of the fast terms."""
        return self.force_of(self.slow), self.force_of(self.fast)

    def force_of(self, terms: Iterable[Term]) -> Force:
        """The force of some terms on the scene's particles."""
        parts = tuple(terms)
        return in_pieces(self._sum(parts, [term.add_force for term in parts]), sum(map(len, parts)))

    def _sum(self, parts: Sequence[Term], added: Sequence[Callable[[Reals, Reals, Reals], None]]) -> Force:
        """Sum of these functions of (q, v, out), one for each term, as a function of (q, p)."""
        needs_velocity = any(term.kind == "friction" for term in parts)

        def total(q: Reals, p: Reals) -> Reals:
            # for one state zeros is four times as fast; zeros_like keeps the memory order of several
            out = np.zeros(q.shape, q.dtype) if q.ndim == 1 else np.zeros_like(q)
            v = p / self.m if needs_velocity else p
            for add in added:
                add(q, v, out)
            return out

        return total

    def magnitude(
        self, near: Reals | None = None, terms: Iterable[Term] | None = None, *, exact: bool = False
    ) -> Force:
        """Like the force of these terms, or of all, with every difference taken as a sum of absolute values.

        Rounding cannot exceed a few eps times this: the running error bound of Wilkinson.  Its arguments are
        sizes of positions and momenta.  Nonlinear laws are evaluated at the states `near` (..., n), a step
        away at most (with `exact` at these positions to the last bit), or without them at the worst position
        within the sizes.
        """
        parts = tuple(self.terms if terms is None else terms)

        def law(q: Reals, p: Reals, *near: Reals) -> Reals:
            at = near[0] if near else None
            adding = [partial(term.add_rounding, near=at, exact=exact) for term in parts]
            return self._sum(parts, adding)(q, p)

        return in_pieces(law, sum(map(len, parts)), *(() if near is None else (near,)))

    @cached_property
    def friction_rates(self) -> Extended:
        """Friction rates c/m of the particles (n,) [1/T], extended precision."""
        brakes = (term for term in self.terms if isinstance(term, Damping))
        m, none = self.m.astype(np.longdouble), np.zeros(self.n, dtype=np.longdouble)
        return self._of_rows(lambda term: term.c / m[term.i], none, brakes)

    def friction_at(self, q: Reals) -> tuple[Reals, Reals]:
        """Friction rates at q (..., n) [1/T], and their derivatives by each particle's position."""
        rates = self.friction_rates.astype(q.dtype) + np.zeros_like(q), np.zeros_like(q)
        for term in (term for term in self.terms if isinstance(term, VanDerPol)):
            for values, each in zip(term.resistance(q), rates, strict=True):
                term.scatter(values / self.m[term.i].astype(q.dtype), each)
        return rates

    def elements(self, q: Reals) -> Iterator[tuple[Integers, Integers, Reals]]:
        """Rows, columns and values (..., s) that each pair of ends adds to the `hessian` at q (..., n)."""
        for term in self.terms:
            yield from term.elements(q)

    def hessian(self, q: Reals) -> Extended:
        """Second derivatives of the potential energy at q (..., n) -> (..., n, n) [M/T2], extended."""
        if self.n > MOST_DENSE:
            what = f"second derivatives of {self.n} particles, n x n numbers,"
            memory.need(2 * 16 * self.n**2, what, "a shorter chain, or another method, needs none")
        out = np.zeros((*q.shape, self.n), dtype=np.longdouble)
        for row, column, k in self.elements(q.astype(np.longdouble)):
            where: Any = (..., row, column)
            np.add.at(out, where, k)
        return out

    def hessian_diagonal(self, q: Reals) -> Extended:
        """Diagonal of `hessian` (..., n), which is all of it for separate particles."""
        wide = q.astype(np.longdouble)
        return self._of_rows(lambda term: term.curvature(wide), np.zeros(q.shape, dtype=np.longdouble))

    def slope(self, q: Reals) -> tuple[Extended, bool]:
        """`hessian_diagonal` for separate particles, otherwise `hessian`; and whether it is the latter."""
        return self.hessian_diagonal(q) if self.is_separate else self.hessian(q), not self.is_separate

    def sparse_hessian(self, q: Reals) -> Any:
        """The `hessian` by its nonzero elements, a scipy.sparse.csc_array in double precision."""
        from scipy.sparse import csc_array

        rows, columns, values = (np.concatenate(x) for x in zip(*self.elements(q), strict=True))
        return csc_array((values.astype(np.float64), (rows, columns)), shape=(self.n, self.n))

    def jacobian(self, q: Floats, p: Floats | None = None) -> Floats:
        """Derivatives of (p/m, force) by (q, p) at q, p (n,) -> (2n, 2n), double precision."""
        upper = np.hstack([np.zeros((self.n, self.n)), np.diag(1 / self.m)])
        bent, rate = self.hessian(q), self.friction_rates
        if self.brakes_by_place and p is not None:
            rate, bend = self.friction_at(q)
            bent = bent + np.diag(bend * p)
        lower = np.hstack([-bent, -np.diag(rate)])
        return np.vstack([upper, lower]).astype(np.float64)

    def curvatures(self, q: Reals) -> Any:
        """Second derivatives in the cheapest form: (n,) for separate particles, otherwise (n, n).

        For more than `MOST_DENSE` particles the matrix is sparse where no term has a negative curvature.
        """
        if self.is_separate:
            return self.hessian_diagonal(q)
        holds = all(np.all(term.curvature(np.asarray(q)) >= 0) for term in self.terms)
        return self.sparse_hessian(q) if self.n > MOST_DENSE and holds else self.hessian(q)

    def gershgorin(self, q: Reals) -> Reals:
        """Bound on the sum of |elements| in each row of the Hessian at q (..., n) -> (..., n) [M/T2]."""
        return self._of_rows(lambda term: _most(term, q) * term.bodies, np.zeros_like(q))

    @cached_property
    def rigidity(self) -> Floats:
        """The bound of `gershgorin` from the terms' absolute curvature at rest alone (n,) [M/T2]."""
        return self._of_rows(lambda term: term.stiffness(self.q) * term.bodies, np.zeros(self.n))

    # energies and sizes

    def kinetic_energy(self, p: Reals) -> Reals:
        """Sum of p**2 / 2m of momenta p (..., n) -> (...) [M L2/T2]."""
        return kinetic_energy(self.m, p)

    def energy(self, q: Reals, p: Reals) -> Reals:
        """Total energy of states q, p (..., n) -> (...) [M L2/T2], whatever the order of the arrays."""
        # NumPy sums rows of another memory order in another order
        q, p = np.ascontiguousarray(q), np.ascontiguousarray(p)
        total = self.kinetic_energy(p)
        for term in self.terms:
            total = total + in_pieces(lambda q, _, term=term: term.energy(q), len(term))(q, p)
        return np.asarray(total)

    @cached_property
    def norm(self) -> Norm:
        """The measure of errors of this scene (see `Norm`)."""
        q, p = self.q.astype(np.longdouble), self.p.astype(np.longdouble)
        with np.errstate(all="ignore"):
            unit = sum((np.abs(term.energy(q)) for term in self.terms), self.kinetic_energy(p))
        away = np.any(self.p) or any(np.any(term.elongation(self.q)) for term in self.terms)
        if not SMALLEST_ENERGY < unit < np.inf and not WIDE and away:
            raise SceneError(
                f"scene {self.scene.name}: the energy of its start is {unit:.0e}, which leaves the range of "
                "numbers of this machine (long double is no wider than double): choose other units"
            )
        return Norm(
            m=self.m,
            terms=self.terms,
            stiffness=[term.stiffness(self.q) for term in self.terms],
            groups=self.free_groups,
            duration=self.duration,
            unit=np.longdouble(np.sqrt(unit or self.gained or 1.0)),
            of="initial T + |V|" if unit else "possible gain" if self.gained else "",
        )

    @cached_property
    @np.errstate(all="ignore")
    def gained(self) -> Any:
        """Energy of the deflection by its forces, drives at full strength, or that they give within the run,
        and of a bath [M L2/T2]."""
        q = self.q.astype(np.longdouble)
        push = np.abs(self.potential_force(q, 0 * q))
        for term in (drive for drive in self.terms if isinstance(drive, Drive)):
            term.scatter(np.abs(term.amplitude), push)
        held = np.maximum(self.hessian_diagonal(q), self.m / self.duration / self.duration)
        return np.sum(push * push / (2 * held)) + self.n * self.scene.thermal

    @cached_property
    def amplitudes(self) -> tuple[Floats, Floats]:
        """Largest position and momentum of each particle (n,) if it had all of the initial energy.

        For a free particle the position is what it could reach within the run.
        """
        unit = float(self.norm.unit)
        k = self._of_rows(lambda term: _most(term, self.q), np.zeros(self.n))
        held = k > 0
        with np.errstate(over="ignore"):
            p = np.sqrt(2.0) * np.sqrt(self.m) * unit
            q = np.where(held, np.sqrt(2 / np.where(held, k, 1)) * unit, p / self.m * self.duration)
        return q, p

    @property
    def far(self) -> float:
        """A length larger than any motion, for joints, which have no negative length; a power of 2 [L]."""
        reach = float(np.max(np.abs(self.q)) + np.max(self.amplitudes[0]))
        return float(2.0 ** np.ceil(np.log2(4 * reach))) if 0 < reach < 2.0**500 else 1.0

    # scenes derived from this one, and their facts

    def beside(self, scene: Fields) -> Self:
        """The facts of a scene that is derived from this one."""
        return type(self)(scene)

    def without(self, key: str) -> Self:
        """The system without the terms of one kind."""
        return self.beside(self.scene.derived(terms=tuple(term for term in self.terms if term.key != key)))

    @cached_property
    def in_single(self) -> Fields:
        """The scene as stored by an engine that keeps the parameters of its potential in single precision."""
        return self.scene.derived(terms=tuple(term.in_single() for term in self.terms))

    def scaled(self, factor: float) -> Fields:
        """The scene with every force of its potential multiplied by a factor."""
        return self.scene.derived(terms=tuple(term.scaled(factor) for term in self.terms))

    def tiled(self, copies: int) -> Fields:
        """So many copies of the scene side by side, without interaction."""
        m, q, p = (np.tile(x, copies) for x in (self.m, self.q, self.p))
        terms = tuple(term.tiled(copies, self.n) for term in self.terms)
        places = self.scene.places
        if places is not None:
            places = (places + 3 * self.scene.particles * np.arange(copies)[:, None]).ravel()
        return self.scene.derived(m=m, q=q, p=p, places=places, terms=terms)

    def from_states(self, q: Floats, p: Floats) -> Fields:
        """Copies of the scene side by side for one step, one from each of these states (c, n)."""
        return self.tiled(len(q)).derived(q=q.ravel(), p=p.ravel(), steps=1, every=1)

    def part(self, chosen: Integers) -> Fields:
        """These particles (s,) alone, renumbered, with the rows of terms that act on them alone."""
        number = np.full(self.n, -1)
        number[chosen] = np.arange(len(chosen))
        m, q, p = (x[chosen] for x in (self.m, self.q, self.p))
        terms = (term.restricted(number) for term in self.terms)
        places = self.scene.places
        if places is not None:
            # renumber the remaining particles
            _, of = np.unique(places[chosen] // 3, return_inverse=True)
            places = 3 * of + places[chosen] % 3
        return self.scene.derived(m=m, q=q, p=p, places=places, terms=tuple(x for x in terms if len(x)))
