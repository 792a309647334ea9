"""Loops and files as students write them: what is said of them is true, whatever their clocks and breaks."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from springcheck.errors import IdentificationError
from springcheck.identify import Identification, identify
from springcheck.physics.arrays import Floats

M, K, Q, V, H = 3.7, 2.9, 0.3, 0.7 / 3.7, 0.1
Step = Callable[[float, float, float], tuple[float, float]]


def verlet(q: float, v: float, h: float, k: float = K) -> tuple[float, float]:
    a = -k * q / M
    q = q + h * v + h * h / 2 * a
    return q, v + h / 2 * (a - k * q / M)


def kick_drift(q: float, v: float, h: float, k: float = K) -> tuple[float, float]:
    v = v - h * k * q / M
    return q + h * v, v


def states(step: Step, h: float = H, frames: int = 201, early: float = 1.0, until: int = 0) -> Floats:
    """Rows t, q, v; the step is `early` times as long until a frame."""
    rows = [(0.0, Q, V)]
    for i in range(frames - 1):
        _, q, v = rows[-1]
        rows.append(((i + 1) * h, *step(q, v, h * early if i < until else h)))
    return np.array(rows)


def rounded(x: Floats, form: str) -> Floats:
    return np.array([float(format(y, form)) for y in x.tolist()])


def seen(rows: Floats, **stated: float) -> Identification:
    t, q, v = rows.T
    return identify(t, q, v=v, **stated)


@pytest.mark.parametrize("h", [0.1, 0.2, 0.04])
@pytest.mark.parametrize("kept", [[*range(101), *range(100, 201)], [*range(90), *range(91, 201)]])
@pytest.mark.parametrize("form", [".17g", ".6g"])
def test_a_frame_twice_or_missing_is_no_rounding_of_tidy_times(h: float, kept: list[int], form: str) -> None:
    rows = states(verlet, h)
    t, q, v = rounded(rows[:, 0], ".2f")[kept], *(rounded(x, form)[kept] for x in rows.T[1:])
    with pytest.raises(IdentificationError, match=r"constant interval: frames (100|89) and (101|90)"):
        identify(t, q, v=v)


def test_the_frame_at_which_a_restart_takes_another_step_is_named() -> None:
    """It was any, as all intervals are as far from their mean."""
    rows = states(verlet, 0.07, 301)
    rows[150:, 0] = rows[150, 0] + 0.05 * np.arange(151)
    with pytest.raises(
        IdentificationError, match=r"150 and 151 are 0\.05 apart, and the two before them 0\.07"
    ):
        seen(rows)


@pytest.mark.parametrize(("h", "form"), [(1 / 30, ".3f"), (1 / 3, ".1f"), (math.pi / 50, ".4f")])
@pytest.mark.parametrize("step", [verlet, kick_drift])
def test_times_of_few_digits_beside_states_of_all_name_no_wrong_scheme_step_or_stiffness(
    h: float, form: str, step: Step
) -> None:
    """The states show the interval of each scheme, and whose it is where it is stated, or the stiffness."""
    rows = states(step, h, 31)
    rows[:, 0] = rounded(rows[:, 0], form)
    name = {verlet: "velocity-verlet", kick_drift: "semi-implicit-euler"}[step]
    found = seen(rows, mass=M)
    right = next(x for x in found.candidates if (x.scheme, x.stride) == (name, 1))
    assert (right.step, *(right.stiffness or ())) == pytest.approx((h, K), rel=1e-12)
    for stated in ({"stiffness": K}, {"step": h}, {"step": float(f"{h:.9g}"), "stiffness": K}):
        found = seen(rows, mass=M, **stated)
        assert found.fits
        assert (found.scheme, found.stride) == (name, 1)
        assert (found.step, *(found.stiffness or ())) == pytest.approx((h, K), rel=1e-12)


@pytest.mark.parametrize(
    "stated", [{"stiffness": 1.001 * K}, {"step": 0.333}, {"step": 1 / 3, "stiffness": 3.0}]
)
def test_what_is_stated_beside_coarse_times_is_held_to_the_digits_of_the_states(
    stated: dict[str, float],
) -> None:
    rows = states(kick_drift, 1 / 3, 31)
    rows[:, 0] = rounded(rows[:, 0], ".1f")
    assert not seen(rows, mass=M, **stated).fits
    # momenta alone show no interval, and no number that follows from it
    found = identify(rows[:, 0], rows[:, 1], M * rows[:, 2], **stated)
    assert ("step" in stated) != any("no frequency or stiffness to more" in x for x in found.notes)


def test_steps_that_coarse_times_leave_open_are_not_named_by_chance() -> None:
    """Forest & Ruth's map is velocity Verlet's in any number of steps, at an interval longer by 1e-5."""

    def forest_ruth(q: float, v: float, h: float) -> tuple[float, float]:
        w = 1 / (2 - 2 ** (1 / 3))
        for drift, kick in ((w / 2, w), ((1 - w) / 2, 1 - 2 * w), ((1 - w) / 2, w), (w / 2, 0.0)):
            q += drift * h * v
            v -= kick * h * K * q / M
        return q, v

    rows = states(forest_ruth, 0.13007, 16)
    rows[:, 0] = rounded(rows[:, 0], ".4g")
    found = seen(rows, mass=M)
    assert (found.scheme, found.verdict) == (None, "not told apart")
    assert {("forest-ruth", 1), ("velocity-verlet", 3)} <= {(x.scheme, x.stride) for x in found.candidates}
    assert "more digits of the times" in found.notes[-1]
    assert seen(rows, mass=M, stiffness=K).scheme == seen(rows, mass=M, step=0.13007).scheme == "forest-ruth"


def test_two_springs_have_one_interval_which_tells_schemes_apart_that_coarse_times_leave_open() -> None:
    rows, other = (states(lambda q, v, h, k=k: verlet(q, v, h, k), 1 / 30, 31) for k in (K, 4 * K))
    t, both = rounded(rows[:, 0], ".3f"), np.stack([rows, other], axis=2)
    found = identify(t, both[:, 1], v=both[:, 2], mass=M)
    assert (found.scheme, found.stride, found.step) == (
        "velocity-verlet",
        1,
        pytest.approx(1 / 30, rel=1e-12),
    )
    assert found.stiffness == pytest.approx((K, 4 * K), rel=1e-12)


def test_coarse_times_of_frames_more_than_half_a_turn_apart_turn_no_velocity() -> None:
    def midpoint(q: float, v: float, h: float) -> tuple[float, float]:
        return q + h * (v - h / 2 * K * q / M), v - h * K / M * (q + h / 2 * v)

    rows = states(midpoint, 0.4109, 251)[::10]
    rows[:, 0] = rounded(rows[:, 0], ".3g")
    found = seen(rows, mass=M)
    assert (found.scheme, found.stride, found.step) == ("rk2-midpoint", 10, pytest.approx(0.4109, rel=1e-13))


def test_a_clock_in_single_precision_makes_no_digits_of_the_stiffness() -> None:
    rows = states(verlet, 0.031, 41)
    clock = np.cumsum(np.r_[0, np.full(40, 0.031)].astype(np.float32), dtype=np.float32)
    found = identify(clock.astype(np.float64), *rows.T[1:2], v=rows[:, 2], mass=M)
    assert found.scheme == "velocity-verlet"
    assert (found.step, *(found.stiffness or ())) == pytest.approx((0.031, K), rel=1e-12)
    assert found.notes[0].startswith("the times show the step to 5e-07 of it")
    # a clock in single precision may stand for a step in it
    rows = states(verlet, float(np.float32(0.1)), 41)
    clock = np.cumsum(np.r_[0, np.full(40, 0.1)].astype(np.float32), dtype=np.float32)
    for step in (0.1, float(np.float32(0.1))):
        found = identify(clock.astype(np.float64), rows[:, 1], v=rows[:, 2], mass=M, stiffness=K, step=step)
        assert (found.fits, found.stiffness) == (True, pytest.approx((K,), rel=1e-12))
    # the first multiples of some such steps need no rounding, and all the same the step has
    clock = np.float32(0.19716) * np.arange(13.0)
    found = seen(np.c_[clock, states(verlet, 0.09858, 25)[::2, 1:]], mass=M)
    assert (found.scheme, found.stride) == ("velocity-verlet", 2)
    assert found.step == pytest.approx(0.09858, rel=1e-12)


@pytest.mark.parametrize("form", [".17g", ".7g"])
@pytest.mark.parametrize("until", [21, 100, 150])
@pytest.mark.parametrize("early", [0.5, 1.01, 2.0])
def test_a_step_that_changes_once_is_said_to_change_at_its_frame(form: str, until: int, early: float) -> None:
    rows = states(kick_drift, early=early, until=until)
    q, v = (rounded(x, form) for x in rows.T[1:])
    said = identify(rows[:, 0], q, v=v).statement
    assert f"up to frame {until}, another of Semi-implicit Euler, kick-drift from there on" in said


def test_newmark_s_parameters_are_those_that_somebody_may_have_chosen() -> None:
    def doubled(q: float, v: float, h: float) -> tuple[float, float]:
        u = v - h * K * q / M
        return q + h * (v + u), u

    assert "Newmark" not in seen(states(doubled), mass=M, stiffness=K).statement


def test_forces_in_single_precision_are_not_called_noise_where_no_mass_shows_them() -> None:
    def single(q: float, v: float, h: float) -> tuple[float, float]:
        a = float(np.float32(-K) * np.float32(q)) / M
        q = q + h * v + h * h / 2 * a
        return q, v + h / 2 * (a + float(np.float32(-K) * np.float32(q)) / M)

    assert seen(states(single)).statement.startswith("Noise or forces in single precision: ")
    assert seen(states(single), mass=M).scheme == "velocity-verlet"


def test_velocities_in_other_units_are_no_scheme_of_a_hundred_steps() -> None:
    t, q, v = states(verlet).T
    found = identify(t, rounded(q, ".6g"), v=rounded(1000 * v, ".6g"), mass=M, stiffness=K)
    assert found.statement.startswith("Velocity Verlet, but velocities would have to be 0.001 times as large")


@pytest.mark.parametrize("frame", [1, 2, 3])
@pytest.mark.parametrize("of", [1, 2])
def test_an_early_frame_that_is_written_wrongly_is_no_scheme_with_memory(frame: int, of: int) -> None:
    rows = states(verlet)
    rows[frame, of] += 1e-4
    assert f"The motion is one of Velocity Verlet, but frame {frame} is wrong" in seen(rows).statement


@pytest.mark.parametrize(
    "wrong", ["velocities late", "no velocity", "frame 0 twice", "frame 50 twice", "one number"]
)
@pytest.mark.parametrize("form", [".17g", ".8g"])
def test_a_bad_frame_of_a_chain_is_no_bath_no_drive_and_no_memory(wrong: str, form: str) -> None:
    m, q, v = np.array([1.3, 0.7, 2.1]), np.array([0.2, 0.0, -0.1]), np.array([0.3, -0.4, 0.2])
    k = np.array([[3.4, -1.1, 0.0], [-1.1, 4.8, -3.7], [0.0, -3.7, 4.6]])
    rows = [(q, v)]
    for _ in range(200):
        v = v - H / 2 * k @ q / m
        q = q + H * v
        v = v - H / 2 * k @ q / m
        rows.append((q, v))
    t, (x, u) = np.arange(201) * H, np.array(rows).transpose(1, 0, 2)
    first = int(wrong.split()[1]) if wrong.startswith("frame") else 0
    if wrong == "velocities late":
        u = np.concatenate([u[:1], u[:-1]])
    elif wrong == "no velocity":
        u[0] = 0
    elif wrong == "one number":
        x[5, 1] += 0.3
    else:
        kept = [*range(first + 1), *range(first, 200)]
        x, u = x[kept], u[kept]
    x, u = (rounded(a.ravel(), form).reshape(a.shape) for a in (x, u))
    where = f"{first} to {first + 1}" if wrong != "one number" else "4 to 6"
    assert identify(t, x, v=u).statement.endswith(f"one map of all coordinates, but not from frame {where}")


def test_bad_frames_at_both_ends_are_counted_in_good_grammar() -> None:
    t, q, _ = states(verlet).T
    assert identify(t, q, v=np.gradient(q, t)).statement.endswith("1 more like it, at frame 200")


def test_positions_alone_do_not_name_a_held_force_where_an_old_force_has_them_too() -> None:
    def old(q: float, v: float, h: float) -> tuple[float, float]:
        a = -K * q / M
        return q + h * v + h * h / 2 * a, v + h * a

    t, q, _ = states(old).T
    found = identify(t, q, mass=M, stiffness=K)
    assert found.scheme is None
    assert "whose second half kick uses the old force" in found.statement


def test_a_spring_that_pushes_and_wrapped_positions_show_a_force() -> None:
    t, q, _ = states(lambda q, v, h: verlet(q, v, h, -K)).T
    with pytest.raises(IdentificationError, match="the motion does not turn"):
        identify(t, q)
    t, q, _ = states(verlet).T
    assert "not those of one linear scheme" in identify(t, (q + 0.25) % 0.5).statement


@pytest.mark.parametrize("step", [verlet, kick_drift])
def test_a_force_of_the_wrong_sign_is_no_matter_of_units(step: Callable[..., tuple[float, float]]) -> None:
    rows = states(lambda q, v, h: step(q, v, h, -K), frames=101)
    (cause,) = seen(rows, mass=M, stiffness=K).explanations
    assert cause.cause.endswith("of a spring -1 times as stiff as stated: the force has the wrong sign")
    assert "sign of the force" in cause.remedy
    assert "units" not in cause.remedy
    # of another size too, both are said
    (cause,) = seen(rows, mass=M, stiffness=K / 2).explanations
    assert cause.cause.endswith("the force has the wrong sign, and k q**2 taken for k/2 q**2")
    assert "sign of the force" in cause.remedy
    assert "units" in cause.remedy


def test_a_friction_stated_as_0_hides_no_mark_of_a_wrong_scheme() -> None:
    def new_force(q: float, v: float, h: float) -> tuple[float, float]:
        q = q + h * v - h * h / 2 * K * q / M
        return q, v - h * K * q / M

    rows = states(new_force)
    for stated in ({"stiffness": K, "friction": 0.0}, {"friction": 0.0}):
        found = seen(rows, mass=M, **stated)
        assert not found.fits
        assert "where 0 is stated, which loses as much area as h k/(2 m): the mark" in found.statement
        assert "factors 1/2" in found.explanations[0].remedy
    # a friction of another size is no mark, and has no unit to look at
    damped = seen(states(lambda q, v, h: verlet(q, v * math.exp(-0.05 * h), h)), mass=M, friction=0.0)
    assert "where 0 is stated" in damped.statement
    assert "unit" not in damped.explanations[0].remedy
    assert "look for a friction" in damped.explanations[0].remedy


@pytest.mark.parametrize(
    ("start", "h", "frames", "room"),
    [(1e3, 0.13, 301, 1e-14), (1e9, 0.13, 301, 1e-14), (1e9, 0.013, 301, 1e-13), (1e5, 0.13, 9, 1e-11)],
)
def test_steps_between_times_that_are_rounded_are_those_of_the_scheme(
    start: float, h: float, frames: int, room: float
) -> None:
    """Each step is the difference of two times, as a solver takes it that is asked for states at times."""
    t = start + h * np.arange(frames)
    rows = [(Q, V)]
    for step in np.diff(t).tolist():
        rows.append(verlet(*rows[-1], step))
    q, v = np.array(rows).T
    found = identify(t, q, v=v, mass=M)
    assert (found.scheme, found.precision) == ("velocity-verlet", "double")
    assert found.stiffness == pytest.approx((K,), rel=room)


def test_the_step_of_a_clock_that_adds_it_up_is_known_to_the_last_bit() -> None:
    """A thirtieth is no short decimal, but it is the second time."""
    h, frames = 0.1 / 3, 1001
    _, q, v = states(verlet, h, frames).T
    found = identify(np.cumsum([0.0, *[h] * (frames - 1)]), q, v=v, mass=M)
    assert (found.scheme, found.step) == ("velocity-verlet", h)
    assert found.stiffness == pytest.approx((K,), rel=1e-14)


def behind(rows: Floats) -> Floats:
    """Velocities one step ahead of the positions."""
    return np.column_stack([rows[:-1, :2], rows[1:, 2]])


@pytest.mark.parametrize(
    "rows",
    [
        behind(states(verlet, frames=61)),
        np.vstack([[-H, Q - H * V, 0.7], states(verlet, frames=61)]),
    ],
    ids=["a step ahead", "wrong start"],
)
def test_the_spring_beside_a_cause_is_that_of_the_cause(rows: Floats) -> None:
    """It was that of the scheme which came nearest: 4.867 beside "Velocity Verlet, but frame 0" on 4.9."""
    found = seen(rows, mass=M)
    assert (found.verdict, found.stiffness) == ("none", pytest.approx((K,), rel=1e-9))
    assert found.omega == pytest.approx((math.sqrt(K / M),), rel=1e-9)


def four_stages(q: float, v: float, h: float) -> tuple[float, float]:
    """Yoshida's scheme with its middle weight of the wrong sign."""
    w = 1 / (2 - 2 ** (1 / 3))
    for part in (w, 2 ** (1 / 3) * w, w):
        q, v = verlet(q, v, part * h)
    return q, v


def test_a_scheme_that_is_only_near_gives_no_numbers() -> None:
    """A stiffness of 939 stood there in 12 digits, of a spring of 4.9, under "a method that is not known"."""
    found = seen(states(four_stages, 0.3, 61), mass=M)
    assert (found.verdict, found.stiffness, found.document()["omega"]) == ("none", None, None)
    assert "frequency" not in str(found)
    assert "stiffness:" not in str(found)


def test_a_velocity_made_from_the_position_is_named_whatever_the_first_frame_leaves() -> None:
    """It was driven or anharmonic, or "in about 10 frames: too few to show its cause"."""
    rows = states(verlet, 0.11, 121)
    # (q2 - q)/2h with q2 = 2 q1 + q - h**2 k/m q1
    rows[1:, 2] = (2 - 0.11**2 * K / M) / 0.22 * rows[1:, 1]
    found = seen(rows, mass=M)
    assert found.statement == (
        "The velocity follows the position: from frame 1 on it is 9.0478 times its distance from rest"
    )


def test_one_oscillator_alone_is_coupled_to_none() -> None:
    """It was "the oscillators are coupled": generalised alpha that moves by h, not by h v."""
    m, k, h, shares = 1.9, 0.8, 0.43, (1 / 3, 4 / 9)
    gamma, beta = 0.5 - shares[0] + shares[1], (1 - shares[0] + shares[1]) ** 2 / 4
    rows, a = [(0.0, 1.3, 0.7)], -k * 1.3 / m
    for i in range(120):
        _, q, v = rows[-1]
        ahead = q + h * v + h * h * (0.5 - beta) * a
        left = -k / m * ((1 - shares[1]) * ahead + shares[1] * q) - shares[0] * a
        new = left / (1 - shares[0] + (1 - shares[1]) * h * h * beta * k / m)
        q = q + h + h * h * ((0.5 - beta) * a + beta * new)
        rows.append(((i + 1) * h, q, v + h * ((1 - gamma) * a + gamma * new)))
        a = new
    assert "are coupled" not in seen(np.array(rows), mass=m).statement


def implicit_midpoint(q: float, v: float, h: float, k: float = K) -> tuple[float, float]:
    a = h * h * k / M / 4
    return ((1 - a) * q + h * v) / (1 + a), ((1 - a) * v - h * k / M * q) / (1 + a)


@pytest.mark.parametrize(
    ("force", "said"),
    [(K * M, "the mass is left out"), (K * K, "the stiffness is squared"), (1.0, "the stiffness is left out"),
     (M * M / K, "mass and stiffness are exchanged"),
     (math.radians(K), "the force takes positions for degrees")],
)  # fmt: skip
def test_a_factor_of_the_stiffness_that_means_something_tells_schemes_of_one_map_apart(
    force: float, said: str
) -> None:
    """It was Position Verlet alone, of a spring 2.32 times as stiff as stated, with the verdict "not told
    apart"."""
    found = seen(states(lambda q, v, h: implicit_midpoint(q, v, h, force)), mass=M, stiffness=K)
    assert (found.scheme, found.fits, found.stiffness) == (
        "implicit-midpoint",
        False,
        pytest.approx((force,)),
    )
    assert found.statement.endswith(f"times as stiff as stated: {said}")


def test_schemes_of_one_map_on_other_springs_than_the_stated_are_all_named() -> None:
    found = seen(states(lambda q, v, h: implicit_midpoint(q, v, h, 1.3 * K), 0.3), mass=M, stiffness=K)
    assert found.statement == (
        "Position Verlet, but of a spring 1.27086457 times as stiff as stated; or Implicit midpoint, but of "
        "a spring 1.3 times as stiff as stated"
    )
    assert not any("the states show" in note for note in found.notes)


def test_a_factor_of_the_stiffness_that_may_mean_several_things_means_each() -> None:
    """Of a mass of 2 it was "k q**2 taken for k/2 q**2", whoever left the mass out."""
    rows, m = [(0.0, Q, V)], 2.0
    for i in range(100):
        _, q, v = rows[-1]
        v = v - H * K * q
        rows.append(((i + 1) * H, q + H * v, v))
    found = seen(np.array(rows), mass=m, stiffness=K)
    assert found.statement.endswith("k q**2 taken for k/2 q**2, or the mass is left out")


def euler(q: float, v: float, h: float) -> tuple[float, float]:
    return q + h * v, v - h * K / M * q


def midpoint(q: float, v: float, h: float) -> tuple[float, float]:
    return q + h * (v - h / 2 * K * q / M), v - h * K / M * (q + h / 2 * v)


@pytest.mark.parametrize(("step", "whose"), [(euler, "Explicit Euler"), (midpoint, "Explicit midpoint (RK2)"),
                                             (implicit_midpoint, "Implicit midpoint")])  # fmt: skip
@pytest.mark.parametrize("side", ["ahead of", "behind"])
def test_velocities_of_another_frame_are_told_of_every_scheme(step: Step, whose: str, side: str) -> None:
    """Explicit Euler's behind were semi-implicit Euler with a negative friction, implicit midpoint's position
    Verlet's on a softer spring."""
    rows = states(step, 0.3, 101)
    at = rows[:-1, :2], rows[1:, 2]
    rows = np.column_stack(at if side == "ahead of" else (rows[1:, :2], rows[:-1, 2]))
    found = seen(rows, mass=M, stiffness=K)
    assert found.statement == f"{whose} whose velocities are one step {side} the positions"
    assert found.stiffness == pytest.approx((K,), rel=1e-9)
    alone = seen(rows, mass=M)
    assert (alone.stiffness is None) == (step is implicit_midpoint), "position Verlet has the same map"


def test_a_factor_of_velocities_is_that_of_the_scheme_that_has_it_to_rounding() -> None:
    """Yoshida's scheme in three steps has the mass as a factor to 5e-7: it was named for Gauss' method."""
    a = np.array([[1 / 4, 1 / 4 - 3**0.5 / 6], [1 / 4 + 3**0.5 / 6, 1 / 4]])
    m, k, h, rows = 3.7, 2.9, 0.31, [(0.0, 1.3, 0.7)]
    slope = np.array([[0, 1], [-k / m, 0]])
    stages = np.linalg.solve(np.eye(4) - h * np.kron(a, slope), np.vstack([slope, slope]))
    one = np.eye(2) + h / 2 * (stages[:2] + stages[2:])
    for i in range(150):
        q, v = one @ rows[-1][1:]
        rows.append(((i + 1) * h, float(q), float(v)))
    found = seen(np.array(rows) * [1, 1, 1 / m], mass=m, stiffness=k)
    assert found.statement.startswith("Gauss collocation, fourth order, but p is treated as a velocity")


def test_forces_in_half_precision_are_no_single_ones() -> None:
    """Each is a single-precision number too: "mixed arithmetic explains every step" was said of it."""
    rows, m, k = [(0.0, 1.3, 0.7)], 1.9, 0.8
    for i in range(150):
        _, q, v = rows[-1]
        v += 0.215 * float(np.float16(-k * q)) / m
        q += 0.43 * v
        rows.append(((i + 1) * 0.43, q, v + 0.215 * float(np.float16(-k * q)) / m))
    found = seen(np.array(rows), mass=m, stiffness=k)
    assert (found.scheme, found.fits) == (None, False)


@pytest.mark.parametrize("step", [verlet, euler, midpoint])
def test_a_motion_that_ends_within_the_file_is_said_to_end(step: Step) -> None:
    """It was "another from there on: the step, the stiffness or the friction changes there"."""
    rows = states(step, 0.3, 151)
    rows[76:, 1:] = rows[75, 1:]
    said = seen(rows, mass=M).statement
    assert said.endswith(" ends: from frame 76 on all frames are frame 75")
    rows[75:, 1:] = 0
    assert seen(rows, mass=M).statement == said.replace(
        "76 on all frames are frame 75", "75 on all numbers are 0"
    )
    rows = states(step, 0.3, 151)
    rows[-1, 1:] = 0
    # it was off by 1e+300 of the state's size
    assert seen(rows, mass=M).statement.endswith("is off by 1 of the state's size")


def test_another_run_from_the_start_is_no_kick() -> None:
    """It was one kick of +1.81, since its position was 1 % beside that of such a kick."""
    m, k, h, q, v = 1.9, 0.8, 0.43, 1.3, 0.7
    a, run = h * h * k / m / 4, [(1.3, 0.7)]
    for _ in range(74):
        q, v = ((1 - a) * q + h * v) / (1 + a), ((1 - a) * v - h * k / m * q) / (1 + a)
        run.append((q, v))
    found = seen(np.column_stack([h * np.arange(150), [*run, *run]]), mass=m)
    assert found.statement.endswith("between frames 74 and 75, as where another run begins")


@pytest.mark.parametrize("rates", ["velocities", "momenta"])
def test_exchanged_columns_are_told_on_any_spring(rates: str) -> None:
    """They were "a one-step method that is not known here" but where w is about 1."""
    t, q, v = states(lambda q, v, h: verlet(q, v, h, 4 * K), 0.3, 101).T
    swapped = identify(t, v, v=q, mass=M) if rates == "velocities" else identify(t, M * v, q, mass=M)
    assert (
        swapped.statement
        == f"Positions and {rates} are exchanged: put right they are those of Velocity Verlet"
    )
    assert swapped.stiffness == pytest.approx((4 * K,), rel=1e-9)


@pytest.mark.parametrize("m", [M, 0.62])
def test_a_step_from_momenta_that_returns_velocities_has_no_friction(m: float) -> None:
    """It was a friction of either sign, "which feeds energy in" of masses below 1."""
    p, rows, h = 0.7 * m, [(0.0, 1.3, 0.7)], 0.11
    for i in range(100):
        v, q = p / m, rows[-1][1]
        a = -K * q / m
        q = q + h * v + h * h / 2 * a
        p = v + h / 2 * (a - K * q / m)
        rows.append(((i + 1) * h, q, p / m))
    found = seen(np.array(rows), mass=m, stiffness=K)
    assert (found.fits, found.statement) == (
        False, "Velocity Verlet whose velocity is divided by the mass in every step",
    )  # fmt: skip


def test_a_gain_by_a_share_of_the_stiffness_is_no_friction_and_a_fault_on_another_spring_says_so() -> None:
    """Kutta's third order with its first slope for the third, and Heun's method without its first force."""

    def kutta(q: float, v: float, h: float) -> tuple[float, float]:
        w = K / M
        v2, a2 = v - h / 2 * w * q, -w * (q + h / 2 * v)
        v3 = v + h * w * q + 2 * h * a2
        return q + h / 6 * (v + 4 * v2 + v3), v + h / 6 * (-2 * w * q + 4 * a2)

    found = seen(states(kutta, 0.31, 121), mass=M, stiffness=K)
    assert found.statement.endswith("by a share of h k/m: the mark of a scheme that is written down wrongly")

    def heun(q: float, v: float, h: float) -> tuple[float, float]:
        return q + h * v - h * h / 2 * K / M * q, v - h / 2 * K / M * (q + h * v)

    rows, fault = states(heun, 0.31, 121), "the midpoint method whose first stage takes a full step"
    assert seen(rows, mass=M).statement == fault
    assert (
        seen(rows, mass=M, stiffness=K).statement == f"{fault}, but of a spring 0.5 times as stiff as stated"
    )


@pytest.mark.parametrize(
    ("step", "whose"), [(implicit_midpoint, "Implicit midpoint"), (verlet, "Velocity Verlet")]
)
def test_a_step_that_is_written_into_a_program_names_the_scheme_of_few_digits(step: Step, whose: str) -> None:
    """Of symmetric schemes it was the exact flow, or implicit midpoint, "or 3.10152 times", and so on."""
    rows = states(step, 0.1, 151)
    rows[:, 0] *= 3.1
    assert seen(rows, mass=M, stiffness=K).statement == (
        f"{whose}, but times are 3.1 times what was stepped: the step taken is 0.322581 times theirs"
    )
