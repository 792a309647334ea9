"""The draws behind states of a scene with rods.

Constant lengths leave fewer numbers in a state than draws act on it, and each draw acts on several: the draws
of a step are found together, by the Gauss-Newton method, in roundings of the state.

Of draws x the positions q' determine combinations V x, V orthonormal and given by the start of the step
alone, and momenta p', which are affine in x once q' is given, further ones orthogonal to them: all are as
independent, and of variance 1, as the draws themselves, whatever rotation mixes them from step to step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.bath.catalogue import Thermostat
from springcheck.bath.draws import Reading
from springcheck.bath.rounding import one_rounding, roundings_of
from springcheck.bath.stepper import Met, Stepper, forces
from springcheck.physics.arrays import Arithmetic, Extended, Floats, Reals
from springcheck.physics.scene import Scene

SMALL_DRAW = 1e-4
"""Step of the central difference in a draw, whose truncation error is its square, 1e-8."""

UNSEEN_DRAW = 1e-6
"""Singular value over the largest below which a combination of draws has no effect: rounding of the quotients
makes 1e-8, also where the reference is no wider than double."""

LEAST_SLOPE = 1e-13
"""The same for combinations that are each known to affect some number of a state."""

MOST_GAUSS_NEWTON = 10
"""Gauss-Newton iterations, each of which about squares a small residual: 4 to 9 are needed."""

MOST_HALVINGS = 8
"""Halvings of a change of draws after which no push along a rod would keep its length: 3 are needed."""


def read(
    scheme: Thermostat, scene: Scene, q: Floats, p: Floats, *, how: Arithmetic | None = None,
    rebuilt: bool = False,
) -> Reading:  # fmt: skip
    """`draws.read` for a scene with rods: draws (f-1, r) are combinations of those of all coordinates."""
    how = how or Arithmetic()
    stepper, sizer = Stepper.of(scheme, scene), Stepper.of(scheme, scene, absolute=True)
    force, rods, c = forces(scheme, scene.system), scene.system.rods, scheme.carried
    wide = q.astype(np.longdouble), p.astype(np.longdouble)
    n, u = scene.n, scheme.draws
    start, end = (wide[0][:-1], wide[1][:-1]), wide[0][1:]
    target = np.concatenate([x[1:] for x in wide], axis=-1)

    def at(x: Extended, met: list[Met] | None = None) -> Extended:
        """State at the end of the step with draws x (f, u n) -> (f, 2 n)."""
        there = None if met is not None else end
        return np.concatenate(stepper(*start, force, np.split(x, u, axis=-1), None, there, met), axis=-1)

    def allowed(x: Extended) -> Extended:
        """One rounding of everything that the steps of these draws add up (f, 2 n)."""
        met: list[Met] = []
        at(x, met)
        sizes = np.split(np.abs(x), u, axis=-1)
        return np.concatenate(one_rounding(scene, sizer, start, sizes, None, how, rebuilt, met), axis=-1)

    x = np.zeros((len(target), u * n), np.longdouble)
    of, now = allowed(x), at(x)
    for iteration in range(MOST_GAUSS_NEWTON):
        # to one side, what bends would show as a combination that does something, where none does
        sides = ((at(x + unit), at(x - unit)) for unit in SMALL_DRAW * np.eye(u * n))
        slopes = [(more - less) / (2 * SMALL_DRAW) for more, less in sides]
        J = _finite(np.stack(slopes, axis=-1) / of[..., None])
        inverse = _pseudoinverse(J)
        change = (inverse @ _finite((target - now) / of)[..., None])[..., 0]
        last = np.all(np.isfinite(now), axis=-1)
        for _ in range(MOST_HALVINGS):
            now = at(x + change)
            if not np.any(beyond := last & ~np.all(np.isfinite(now), axis=-1)):
                break
            change[beyond] /= 2
        else:
            now = at(x + change)
        x = x + change
        if iteration == 1:
            of = allowed(x)
        elif iteration and np.all(np.abs(change) <= 1e-9 * (1 + np.abs(x))):
            # the next change would be smaller by the relative error of the slopes: by 1e-8
            break
    of = allowed(x)
    left = np.asarray(((target - now) / of) ** 2, np.float64)
    # of all draws those that were found leave the least, in the mean over the numbers of a state
    across = np.sqrt(np.mean(left, axis=-1, keepdims=True))
    first = _pseudoinverse(J[:, :n]) @ J[:, :n]
    V = _carried(first), _carried(inverse @ J - first)
    if c:
        # what both steps beside a state say of the draw that acts in them, across the rods there
        assert rods is not None
        root, unit = np.sqrt(scene.m), np.sum(np.abs(inverse), axis=-1)
        one, other = (rods.projected(wide[0][1:-1], root * y) / root for y in (x[1:, :n], x[:-1, n:]))
        sizes = one - other, unit[1:, :n], unit[:-1, n:]
        off, *units = (np.sqrt(np.sum(y**2, axis=-1)) for y in sizes)
        across = np.maximum(across[1:], (off / sum(units))[:, None])
    turned = np.swapaxes(V[1] if c else np.concatenate(V, axis=-1), -1, -2)
    roundings = roundings_of(scheme, scene)
    return Reading(
        draws=(turned @ np.asarray(x, np.float64)[..., None])[..., 0],
        error=roundings * np.sum(np.abs(turned @ inverse), axis=-1),
        across=np.asarray(across, np.float64) if u == 1 or c else None, roundings=roundings,
        allowed=(of[:, :n], of[:, n:]),
    )  # fmt: skip


def _finite(values: Reals) -> Floats:
    """In double precision; NaN and infinity become 0, and show in the residual."""
    return np.nan_to_num(np.asarray(values, np.float64), nan=0.0, posinf=0.0, neginf=0.0)


def _pseudoinverse(J: Floats) -> Floats:
    """That of slopes (f, k, r), where combinations of draws that do nothing are left out.

    What a draw does to a heavy particle, or to a position in a short step, may be small beside what others do
    and is not nothing: each number of a state is measured by its own largest slope.
    """
    size = np.linalg.norm(J, axis=-1, keepdims=True)
    even = J / np.where(size > 0, size, 1)
    weights = (np.linalg.svd(of, compute_uv=False) for of in (even, J))
    seen, of_all = (each > UNSEEN_DRAW * each[:, :1] for each in weights)
    if np.array_equal(np.sum(seen, axis=-1), np.sum(of_all, axis=-1)):
        return np.asarray(np.linalg.pinv(J, rcond=UNSEEN_DRAW))
    basis = np.swapaxes(np.linalg.svd(even, full_matrices=False)[2] * seen[..., None], -1, -2)
    return np.asarray(basis @ np.linalg.pinv(J @ basis, rcond=LEAST_SLOPE))


def _carried(projectors: Any) -> Floats:
    """An orthonormal basis (f, k, r) of what each of these (f, k, k) projects on, each turned as little as
    can be from the one before: it depends on nothing but them and those before."""
    size, vectors = np.linalg.eigh(projectors[0])
    basis = vectors[:, size > 0.5]
    out = np.empty((len(projectors), *basis.shape))
    for row, projector in zip(out, projectors, strict=True):
        left, _, right = np.linalg.svd(projector @ basis, full_matrices=False)
        basis = row[...] = left @ right
    return out
