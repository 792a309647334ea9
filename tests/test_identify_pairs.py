"""Two particles on a bond in space: named by their distance, where their middle moves, walks or rests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from springcheck.identify import identify

M, K, REST, H, N = (3.7, 1.9), 2.9, 1.1, 0.1, 300
WAY = np.array([1.0, 2.0, -2.0]) / 3


def swing(
    width: Any = np.float64,
    *,
    drift: Any = (0.0, 0.0, 0.0),
    more: float = 0.0,
    centre: float = 0.0,
    late: bool = False,
) -> tuple[np.ndarray, ...]:
    """Times, positions (f, 6) and velocities of velocity Verlet in the width of a float; `more` ties the
    second particle to the origin, `late` takes the force of the step before."""
    m = np.array(M)
    q = np.stack(
        [centre - WAY * REST * 1.1 * m[1] / m.sum(), centre + WAY * REST * 1.1 * m[0] / m.sum()]
    ).astype(width)
    v = (np.array(drift) + np.outer([-0.2 * m[1] / m.sum(), 0.2 * m[0] / m.sum()], WAY)).astype(width)
    h, m = width(H), m.astype(width)[:, None]

    def force(q: Any) -> Any:
        d = q[1] - q[0]
        r = np.sqrt(np.sum(d * d))
        pull = width(K) * (r - width(REST)) / r * d
        return np.stack([pull, -pull - width(more) * q[1]])

    rows_q, rows_v, f = [q], [v], force(q)
    old = f
    for _ in range(N):
        v = v + h / 2 * (old if late else f) / m
        q = q + h * v
        old, f = f, force(q)
        v = v + h / 2 * f / m
        rows_q.append(q)
        rows_v.append(v)
    return H * np.arange(N + 1), *(np.array(x).reshape(N + 1, 6) for x in (rows_q, rows_v))


def named(t: Any, q: Any, v: Any, **stated: Any) -> Any:
    return identify(t, q, v=v, **stated)


def test_a_pair_that_drifts_through_space_is_named_by_its_distance() -> None:
    """It was said to be driven or anharmonic."""
    found = named(*swing(drift=(0.031, -0.017, 0.023)), step=H)
    assert found.scheme == "velocity-verlet"
    assert any("their distance is judged" in note for note in found.notes)


def test_a_pair_whose_middle_walks_by_forces_that_are_cut_off_is_named_by_its_distance() -> None:
    """What fixed point cuts off adds up: it was said to be driven or anharmonic from some frame on."""
    t, q, v = swing(drift=(0.031, -0.017, 0.023))
    n = np.arange(N + 1)[:, None]
    assert named(t, q + 3e-16 * H * n * n / 2, v + 3e-16 * n).scheme == "velocity-verlet"


def test_a_pair_whose_velocities_are_differences_of_positions_far_from_the_origin_is_named() -> None:
    """They carry the rounding of the positions, not that of the distance: the scheme was called unknown."""
    m, h = np.array(M)[:, None], 0.1
    q = np.stack([-WAY * 0.4, WAY * 0.78])
    v = np.array([[0.3, -0.15, 0.31], [0.3, -0.15, 0.31]])
    rows = [(q, v)]
    for _ in range(800):
        d = q[1] - q[0]
        r = np.sqrt(np.sum(d * d))
        pull = K * (r - REST) / r * d
        new = q + h * (v + h * np.stack([pull, -pull]) / m)
        q, v = new, (new - q) / h
        rows.append((q, v))
    x, u = (np.array(y).reshape(len(rows), 6) for y in zip(*rows, strict=True))
    found = named(h * np.arange(len(rows)), x, u)
    assert found.scheme == "semi-implicit-euler"
    assert any("rebuilt as a difference" in note for note in found.notes)


def test_of_a_pair_that_no_scheme_explains_the_distance_is_spoken_of() -> None:
    """A coordinate of it swings about a place that moves, and is no oscillator."""
    found = named(*swing(drift=(0.031, -0.017, 0.023), late=True))
    assert "memory" in found.statement
    assert any("their distance is judged" in note for note in found.notes)


def test_a_pair_in_single_precision_away_from_the_origin_is_named_with_its_arithmetic() -> None:
    """As GROMACS writes it: each coordinate swings about a place that walks."""
    t, q, v = swing(np.float32, centre=9.0)
    found = named(t, q.astype(np.float32), v.astype(np.float32), step=H)
    assert found.scheme == "velocity-verlet"
    assert "single" in str(found)


def test_a_force_from_outside_or_one_that_is_late_is_no_scheme() -> None:
    drift = (0.031, -0.017, 0.023)
    assert named(*swing(drift=drift, more=1e-3), step=H).scheme is None
    assert named(*swing(drift=drift, late=True), step=H).scheme is None
    assert named(*swing(np.float32, centre=9.0, late=True), step=H).scheme is None


def test_a_pair_whose_line_turns_is_not_named_by_its_distance() -> None:
    t, q, v = swing()
    v = v + 0.05 * np.array([0, 1, 1, 0, -1, -1]) / np.array([3.7] * 3 + [1.9] * 3)
    found = named(t, q, v, step=H)
    assert found.scheme is None
    assert not any("their distance is judged" in note for note in found.notes)


def on_a_spring(q: float, v: float) -> np.ndarray:
    """Positions and velocities (2, N) of the first particle by velocity Verlet."""
    rows = []
    for _ in range(N):
        rows.append((q, v))
        v -= H / 2 * K / M[0] * q
        q += H * v
        v -= H / 2 * K / M[0] * q
    return np.array(rows).T


def test_a_stiffness_of_half_the_springs_is_of_a_bond_only_where_two_particles_move_oppositely() -> None:
    one, other = on_a_spring(1.1, 0.4), on_a_spring(0.3, 0.9)
    for second, scheme in ((-one, "velocity-verlet"), (other, None)):
        q, v = np.stack([one, second], axis=2)
        found = identify(H * np.arange(N), q, v=v, mass=M[0], stiffness=K / 2)
        assert (found.scheme, found.fits) == (scheme, scheme is not None)
        bound = "the two halves of the coordinates are two particles bound to each other, at rest as a whole"
        assert any(note.startswith(bound) for note in found.notes) == found.fits


@pytest.mark.parametrize(("columns", "bond"), [((0, 3), True), ((0, 4), False), ((0, 1), False)], ids=str)
def test_the_stiffness_of_a_bond_is_that_of_two_particles_along_one_axis(
    columns: tuple[int, int], bond: bool
) -> None:
    """Opposite motions along x and y, or of one particle, are of no bond of two particles."""
    rows = on_a_spring(1.1, 0.4)
    q, v = (np.zeros((N, 6)) for _ in range(2))
    for column, sign in zip(columns, (1, -1), strict=True):
        q[:, column], v[:, column] = sign * rows
    found = identify(H * np.arange(N), q, v=v, mass=M[0])
    assert (found.scheme, found.fits) == ("velocity-verlet", True)
    assert [f"their bond has the stiffness {K / 2:g}" in note for note in found.notes].count(True) == bond
