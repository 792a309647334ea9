"""What moves beside a scheme, in other coordinates or from outside, is no scheme's, solver's or memory's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from springcheck.identify import identify

H = 0.39
Force = Callable[[Any, Any, float], Any]


def verlet(q: Any, v: Any, t: float, force: Force) -> tuple[Any, Any]:
    v = v + H / 2 * force(q, v, t)
    q = q + H * v
    return q, v + H / 2 * force(q, v, t + H)


def heun(q: Any, v: Any, t: float, force: Force) -> tuple[Any, Any]:
    a = force(q, v, t)
    b = force(q + H * v, v + H * a, t + H)
    return q + H / 2 * (v + v + H * a), v + H / 2 * (a + b)


def march(step: Any, q: Any, v: Any, force: Force, frames: int, every: int = 1) -> tuple[Any, Any, Any]:
    states = [(q, v)]
    for i in range((frames - 1) * every):
        states.append(step(*states[-1], i * H, force))
    q, v = (np.array(x)[::every] for x in zip(*states, strict=True))
    return np.arange(frames) * (H * every), q, v


def test_a_particle_beside_two_that_a_field_turns_names_no_scheme_of_all() -> None:
    # along unlike springs, so that no rotation is left over; the modes of the two are none
    k = np.array([0.62, 0.27, 0.49])

    def force(q: Any, v: Any, t: float) -> Any:
        return -k * q + 0.3 * np.array([v[1], -v[0], 0.0])

    q, v = np.array([1.1, -0.4, 0.7]), np.array([0.3, 0.6, -0.2])
    t, q, v = march(verlet, q, v, force, 200)
    found = identify(t, q, v=v, mass=2.3)
    assert (found.scheme, found.fits) == (None, False)
    assert found.statement.startswith("The oscillators are coupled")


def test_a_drive_beside_a_motion_that_grows_is_no_memory() -> None:
    def force(q: Any, v: Any, t: float) -> Any:
        return -7.9 * q + 0.02 * np.cos(1.9 * t)

    t, q, v = march(heun, 1.1, 0.4, force, 101)
    found = identify(t, q, v=v, mass=2.3)
    assert not found.fits
    assert "memory" not in found.statement


def test_an_anharmonic_motion_is_no_exact_solution_of_an_adaptive_solver() -> None:
    def force(q: Any, v: Any, t: float) -> Any:
        return -0.43 / 0.04 * (1 - np.exp(-0.04 * q)) * np.exp(-0.04 * q)

    t, q, v = march(verlet, 0.6, -0.3, force, 50, every=5)
    found = identify(t, q, v=v)
    assert found.statement.startswith("The motion is anharmonic")


def test_how_many_steps_were_looked_at_with_friction_is_said() -> None:
    def force(q: Any, v: Any, t: float) -> Any:
        return -1.9 * q - 0.11 * v

    t, q, v = march(heun, 0.6, -0.3, force, 20, every=20)
    found = identify(t, q, v=v)
    assert found.verdict == "none"
    assert "in up to 100 steps to a frame, or 12 with friction" in found.statement


def test_coarse_velocities_of_the_other_sign_name_no_scheme_on_a_stiffer_spring() -> None:
    seen = 0
    for k in (0.7, 1.0, 3.1, 4.4):
        for digits in (4, 6):
            a = 2.3
            h = 0.06 / np.sqrt(k / a)
            q, v, rows = 0.8, -0.5, []
            for _ in range(24):
                rows.append((q, -v))
                v -= h / 2 * k * q / a
                q += h * v
                v -= h / 2 * k * q / a
            text = np.array([[float(f"{x:.{digits}g}") for x in row] for row in rows])
            t = h * np.arange(24)
            found = identify(t, text[:, 0], v=text[:, 1], mass=a)
            assert found.scheme is None
            assert not found.fits
            cause = found.explanations[0].cause
            assert "wrong sign" in cause
            seen += "nearly comes round" in cause
            right = identify(t, text[:, 0], v=-text[:, 1], mass=a)
            assert not any("wrong sign" in x.cause for x in right.explanations)
    assert seen >= 2


@pytest.mark.parametrize("step", [verlet, heun])
@pytest.mark.parametrize(("share", "frames", "every"), [(3e-4, 120, 1), (0.02, 60, 1), (0.03, 40, 2)])
def test_dry_friction_is_told_with_its_force(step: Any, share: float, frames: int, every: int) -> None:
    """A memory, few frames, a thermostat of Andersen's were seen in it."""
    m, k = 2.3, 1.7
    dry = share * k

    def force(q: Any, v: Any, t: float) -> Any:
        return (-k * q - dry * np.sign(v)) / m

    t, q, v = march(step, 1.1, 0.4, force, frames, every)
    found = identify(t, q, v=v, mass=m, stiffness=k)
    assert (found.scheme, found.fits) == (None, False)
    assert found.statement.startswith("Dry (Coulomb) friction acts")
    said = float(found.statement.split("one size, ")[1].split()[0])
    assert np.isclose(said, dry, rtol=1e-2 if step is verlet else 0.1)


@pytest.mark.parametrize(
    ("share", "h", "frames"), [(0.02, 0.39, 200), (0.3, 0.2, 40), (0.3, 0.39, 200), (0.02, 0.39, 12)]
)
def test_dry_friction_that_holds_a_motion_in_the_end_or_of_few_frames_is_told(
    share: float, h: float, frames: int
) -> None:
    """From where the velocity changes its sign in every frame it was Andersen's thermostat."""
    q, v, rows = 1.1, 0.4, []
    for _ in range(frames):
        rows.append((q, v))
        v -= h * 1.7 * (q + share * np.sign(v))
        q += h * v
    q, v = np.array(rows).T
    found = identify(h * np.arange(frames), q, v=v, mass=1.0, stiffness=1.7)
    assert (found.scheme, found.fits) == (None, False)
    assert found.statement.startswith(f"Dry (Coulomb) friction acts: a force of one size, {1.7 * share:.6g} ")


@pytest.mark.parametrize(("share", "long"), [(0.05, 0.2), (0.1, 0.1), (0.1, 0.2), (0.3, 0.1)])
def test_strong_dry_friction_whose_stages_cancel_where_it_holds_is_told(
    share: float, long: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There Heun's two stages push either way, and the velocity changes its sign no more."""
    monkeypatch.setitem(globals(), "H", long)

    def force(q: Any, v: Any, t: float) -> Any:
        return -1.7 * (q + share * np.sign(v))

    t, q, v = march(heun, 1.1, 0.4, force, 200)
    found = identify(t, q, v=v, mass=1.0)
    assert (found.scheme, found.fits) == (None, False)
    assert found.statement.startswith("Dry (Coulomb) friction acts")


def test_what_misses_by_the_size_of_the_state_is_no_exact_solution() -> None:
    def force(q: Any, v: Any, t: float) -> Any:
        return -1.7 * q - 0.17 * np.sign(v)

    t, q, v = march(heun, 1.1, 0.4, force, 200)
    assert "exact solution" not in identify(t, q, v=v, mass=1.0, stiffness=1.7).statement


def test_a_repeated_frame_of_a_motion_with_quadratic_drag_names_no_scheme_of_the_rest() -> None:
    """What the drag leaves over makes the map of the other frames so uncertain that others fit it."""

    def explicit(q: Any, v: Any, t: float, force: Force) -> tuple[Any, Any]:
        return q + H * v, v + H * force(q, v, t)

    def force(q: Any, v: Any, t: float) -> Any:
        return -0.66 * q - 0.68 * np.abs(v) * v

    t, q, v = march(explicit, 0.7, 0.2, force, 201)
    q, v = (np.insert(x, 131, x[131])[:201] for x in (q, v))
    assert identify(t, q, v=v).statement.startswith("The motion stands still for a step: it is repeated at")


@pytest.mark.parametrize("drag", [0, 1])
@pytest.mark.parametrize(
    ("step", "every_h", "frames"), [(verlet, 0.3, 60), (verlet, 0.1, 200), (heun, 0.3, 60)]
)
def test_few_digits_do_not_tell_a_small_quadratic_drag_from_friction_and_say_so(
    step: Any, every_h: float, frames: int, drag: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drag's friction is known to 50 of its errors; a linear one of ten times its size shows."""
    monkeypatch.setitem(globals(), "H", every_h)

    def force(q: Any, v: Any, t: float) -> Any:
        return -1.7 * q - (0.003 * np.abs(v) * v if drag else 0.03 * v)

    t, q, v = march(step, 1.1, 0.4, force, frames)
    q, v = (np.array([float(f"{x:.3g}") for x in y]) for y in (q, v))
    found = identify(t, q, v=v, mass=1.0, stiffness=1.7, step=every_h)
    assert found.fits
    assert ("not known here" in found.statement) == bool(drag)


@pytest.mark.parametrize("step", [verlet, heun])
@pytest.mark.parametrize(
    ("depth", "steepness", "m", "q", "v", "h"),
    [
        (1.46, 0.98, (0.237, 1.698), (9.82, 12.7), (2.16, 0.04), 0.0472),
        (0.46, 0.98, (0.559, 0.214), (0.96, -0.5), (-0.11, 1.05), 0.0567),
    ],
    ids=["long swings", "into free flight"],
)
def test_a_bond_that_softens_has_no_memory_and_no_bath(
    step: Any, depth: float, steepness: float, m: Any, q: Any, v: Any, h: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """What fades with the distance was a start-up, and a factor below 0 in most steps a thermostat's."""
    monkeypatch.setitem(globals(), "H", h)
    m, q, v = map(np.array, (m, q, v))

    def force(q: Any, v: Any, t: float) -> Any:
        near = np.exp(-steepness * (q[1] - q[0] - 0.25))
        return 2 * depth * steepness * (1 - near) * near * np.array([1, -1]) / m

    t, q, v = march(step, q, v, force, 251)
    found = identify(t, q, v=v)
    assert not found.fits
    assert not any(word in found.statement for word in ("memory", "thermostat", "several"))


def test_a_relaxation_oscillation_has_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "H", 0.013)

    def force(q: Any, v: Any, t: float) -> Any:
        return (-1.29 * q + 0.249 * (1 - (q / 0.256) ** 2) * v) / 0.397

    t, q, v = march(verlet, 1.2, -3.5, force, 251)
    found = identify(t, q, v=v)
    assert not found.fits
    assert "memory" not in found.statement
