"""What is wrong with engines along y and z and in a periodic box, where a scene along x sees nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from springcheck import schemes
from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.faults.seeded import half_step
from springcheck.studies.faults.steppers import State, Step, textbook


def _on(scene: Scene, axis: str) -> NDArray[np.bool_]:
    """Which coordinates of a scene lie along an axis (n,)."""
    return np.asarray(scene.all_places % 3 == "xyz".index(axis))


def stiffer(axis: str) -> Callable[[Scene, float], Scene]:
    """Springs too stiff by a fraction along one axis."""

    def change(scene: Scene, size: float) -> Scene:
        factor = np.where(_on(scene, axis), 1 + size, 1.0)
        return scene.derived(terms=tuple(term.scaled(factor[term.particles[0]]) for term in scene.terms))

    return change


def heavier(axis: str) -> Callable[[Scene, float], Scene]:
    """Masses too large by a fraction along one axis."""
    return lambda scene, size: scene.derived(m=scene.m * (1 + size * _on(scene, axis)))


def along(axis: str, change: Callable[[Reals], Reals]) -> Callable[[Scene, schemes.Scheme, float], Step]:
    """Another force along one axis."""

    def broken(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        right, on = scene.system.force, _on(scene, axis)

        def force(q: Reals, p: Reals) -> Reals:
            f = right(q, p)
            return np.where(on, change(f), f)

        return textbook(scene, scheme, force=force)

    return broken


def _by_axis(scene: Scene) -> Integers:
    """The coordinates along x, y and z of particles that move in space (3, particles), or of none."""
    found = [np.flatnonzero(_on(scene, axis)) for axis in "xyz"]
    return np.array(found) if len({len(one) for one in found}) == 1 else np.empty((3, 0), np.int64)


def swapped_axes(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """The force along y acts along z, and the other way round."""
    right, (_, y, z) = scene.system.force, _by_axis(scene)
    order = np.arange(scene.n)
    order[y], order[z] = z, y
    return textbook(scene, scheme, force=lambda q, p: right(q, p)[..., order])


def momenta_swapped(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Momenta in another order of the axes."""
    x, y, _ = _by_axis(scene)
    p = run.p.copy()
    p[:, x], p[:, y] = run.p[:, y], run.p[:, x]
    return replace(run, p=p)


def torque(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """A force z x q beside that of the springs, in units of the first stiffness."""
    right, (x, y, _) = scene.system.force, _by_axis(scene)
    k = float(scene.system.hessian_diagonal(scene.q)[0])

    def force(q: Reals, p: Reals) -> Reals:
        f = right(q, p).copy()
        f[..., x] -= size * k * q[..., y]
        f[..., y] += size * k * q[..., x]
        return f

    return textbook(scene, scheme, force=force)


def rotated(scene: Scene, size: float, i: int, state: State) -> State:
    """Momenta turned in the plane of x and y."""
    (q, p), (x, y, _) = state, _by_axis(scene)
    turned = p.copy()
    turned[x], turned[y] = p[x] - size * p[y], p[y] + size * p[x]
    return q, turned


def wrapped(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Positions along y in a box of half of their span."""
    box = max(float(np.ptp(run.q)) / 2, 1e-300)
    return replace(run, q=np.where(_on(scene, "y"), run.q - box * np.round(run.q / box), run.q))


def nearest_image(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """The force of the nearest image of the wall, in a box of the amplitude."""
    right, box = scene.system.force, 1.5 * float(np.max(scene.system.amplitudes[0]))
    return textbook(scene, scheme, force=lambda q, p: right(q - box * np.round(q / box), p))


def late_z(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Momenta along z half a step early."""
    return replace(run, p=np.where(_on(scene, "z"), half_step(scene, -1, run).p, run.p))


def still_z(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Positions along z as at the start."""
    return replace(run, q=np.where(_on(scene, "z"), run.q[0], run.q))


def planar_friction(scene: Scene, size: float, i: int, state: State) -> State:
    """Friction along x and y alone."""
    q, p = state
    return q, np.where(_on(scene, "z"), p, p * (1 - size))


def pair_in_a_box(name: str) -> Scene:
    """Two particles in the plane, their bond across two borders of a box at the start, which drift."""
    return Scene(
        m=np.array([3.7, 3.7, 1.3, 1.3]),
        q=np.array([4.0, 0.2, 4.3, -0.1]),
        p=np.array([2.9, -0.7, 0.4, -1.1]),
        places=np.array([0, 1, 3, 4]),
        terms=(Spring(a=np.array([0, 1]), b=np.array([2, 3]), k=np.array([2.9, 2.9]), rest=np.zeros(2)),),
        box=(4.1, 3.3, 5.7),
        step=0.1,
        steps=200,
        name=name,
    )


def _crossed(scene: Scene, q: Reals) -> Reals:
    """Borders of the box that positions (..., n) have crossed, counted from the box; none without one."""
    return np.zeros_like(q) if scene.box is None else np.floor(q / scene.periods)


def imaged(nearest: Callable[[Reals, Floats], Reals]) -> Callable[[Scene, schemes.Scheme, float], Step]:
    """Bonds between positions that are put back into the box: nearest(difference, box) instead of the one
    that is."""

    def broken(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        right, box = scene.system.force, scene.periods
        bonds = [term for term in scene.terms if isinstance(term, Spring) and scene.box]

        def force(q: Reals, p: Reals) -> Reals:
            x, y = q - box * _crossed(scene, q), q.copy()
            for term in bonds:
                y[..., term.b] = q[..., term.a] + nearest(x[..., term.b] - x[..., term.a], box[term.a])
            return right(y, p)

        return textbook(scene, scheme, force=force)

    return broken


def swapped_images(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Positions of particles in a plane, unwrapped along each axis by the image counts of the other."""
    if scene.box is None:
        return run
    crossed = _crossed(scene, run.q)
    crossed -= crossed[:1]
    other = crossed.reshape(len(crossed), -1, 2)[..., ::-1].reshape(crossed.shape)
    return replace(run, q=run.q + (other - crossed) * scene.periods)


def late_images(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Positions unwrapped by the image counts of the frame before."""
    crossed = _crossed(scene, run.q)
    crossed[1:] -= crossed[:-1].copy()
    crossed[0] = 0
    return replace(run, q=run.q - crossed * scene.periods)
