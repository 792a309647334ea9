"""Of the four entries of the map between two states one fixes (h w)**2, and the scheme predicts the others.

Trajectories are made by stepping each scheme in double precision over random springs; what comes back must
be the scheme, its stride, its frequency and the arithmetic, or a plain statement that the states do not
decide.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from springcheck.doors.function import load
from springcheck.errors import IdentificationError, MethodError
from springcheck.identify import Identification, identify, identify_stepper
from springcheck.identify.hypothesis import aliases
from springcheck.identify.result import UNTOLD, rounded_by
from springcheck.physics.arrays import Floats, Force
from springcheck.schemes import SCHEMES, matrix, number, step

STEPPING = [s.name for s in SCHEMES.values() if s.has("one-step") and not s.has("mixes")]
SPRINGS = 4
"""Random springs per scheme; validation/identify_census.py takes 200."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    t: Floats
    q: Floats
    p: Floats
    m: Floats
    k: Floats
    h: float
    stride: int

    @property
    def names(self) -> dict[str, Floats]:
        return {"mass": self.m, "stiffness": self.k}


def case(
    name: str,
    rng: np.random.Generator,
    *,
    n: int = 1,
    stride: int = 1,
    frames: int = 101,
    lowest: float = 0.02,
    highest: float | None = None,
    coarse: Force | None = None,
    width: type = np.float64,
) -> Case:
    """Springs of uneven m and k, h w log-uniform from `lowest` to `highest`: 1.5, or 0.95 of the limit."""
    scheme = SCHEMES[name]
    highest = highest or (min(1.5, 0.95 * scheme.limit) if scheme.limit > 0 else 1.0)
    m, h = 10 ** rng.uniform(-2, 2, n), float(10 ** rng.uniform(-3, 1))
    x = np.exp(rng.uniform(np.log(lowest), np.log(highest), n))
    k = m * (x / h) ** 2
    q = rng.normal(size=n) * 10 ** rng.uniform(-1, 2)
    p = m * x / h * np.abs(q[0]) * rng.normal(size=n)
    force = coarse or (lambda q, p: np.asarray(-k.astype(q.dtype) * q))
    damping = np.full(n, 0.07 / h) if name.startswith("langevin") else None
    states = [(q.astype(width), p.astype(width))]
    for _ in range(frames - 1):
        now = states[-1]
        for _ in range(stride):
            now = step(scheme, *now, h=h, m=m, force=force, stiffness=np.diag(k), rate=damping)
        states.append(now)
    qs, ps = (np.array([s[i] for s in states], dtype=np.float64) for i in (0, 1))
    return Case(t=np.arange(frames) * (stride * h), q=qs, p=ps, m=m, k=k, h=h, stride=stride)


def single(x: Floats) -> Floats:
    return x.astype(np.float32).astype(np.float64)


def text(x: Floats, form: str = "%.6g") -> Floats:
    return np.array([float(form % y) for y in x.ravel()]).reshape(x.shape)


def right(found: Identification, name: str, made: Case) -> bool:
    return name in (found.scheme, *found.aliases) and found.stride == made.stride


def schemes(found: Identification) -> set[str]:
    return {x.scheme for x in found.candidates}


@pytest.mark.campaign
@pytest.mark.parametrize("name", STEPPING)
def test_a_scheme_is_named_with_its_stride_stiffness_and_precision(name: str) -> None:
    rng = np.random.default_rng(len(name) + 1)
    for i in range(SPRINGS):
        made = case(name, rng, stride=1 + 2 * i)
        found = identify(made.t, made.q, made.p, **made.names)
        assert right(found, name, made), found
        assert found.precision == "double"
        assert found.fits
        assert found.stiffness == pytest.approx(made.k, rel=1e-11)
        assert found.omega == pytest.approx(np.sqrt(made.k / made.m), rel=1e-11)
        assert found.step == pytest.approx(made.h, rel=1e-12)
        if not name.startswith("langevin"):
            expected = matrix(SCHEMES[name], h=made.h, m=made.m, k=made.k)[0].astype(float)
            assert found.determinant[0] == pytest.approx(float(np.linalg.det(expected)), rel=1e-10)


@pytest.mark.parametrize(
    ("name", "h_w", "stride"),
    [("rk4", 2.6, 1), ("rk4", 2.8, 1), ("rk4", 4.5, 1), ("velocity-verlet", 1.995, 1),
     ("velocity-verlet", 1.999, 1), ("velocity-verlet", 2.2, 2), ("semi-implicit-euler", 1.9985, 1),
     ("forest-ruth", 1.57, 1), ("forest-ruth", 1.58, 1), ("forest-ruth", 2.2, 1)],
)  # fmt: skip
def test_a_scheme_is_named_at_its_limit_of_stability_and_beyond(name: str, h_w: float, stride: int) -> None:
    """RK4 is stable up to 2.83, where it turns by 1.4 half turns, and Forest & Ruth's scheme up to 1.5734."""
    made = case(name, np.random.default_rng(3), stride=stride, frames=16, lowest=h_w, highest=h_w)
    found = identify(made.t, made.q, made.p, mass=made.m)
    assert (found.scheme, found.stride, found.precision) == (name, stride, "double"), found
    assert found.stiffness == pytest.approx(made.k, rel=1e-10)


@pytest.mark.parametrize("name", STEPPING)
def test_numbers_of_single_precision_are_told_from_arithmetic_of_single_precision(name: str) -> None:
    made = case(name, np.random.default_rng(11), stride=2, frames=61, lowest=0.3)
    found = identify(made.t, single(made.q), single(made.p), **made.names)
    assert right(found, name, made), found
    assert (found.precision, found.fits) == ("double, stored in single", True)


@pytest.mark.parametrize("written", ["nine digits", "momenta"])
def test_numbers_of_single_precision_are_seen_behind_nine_digits_and_momenta(written: str) -> None:
    made = case("velocity-verlet", np.random.default_rng(11), frames=61, lowest=0.3)
    q, v = single(made.q), single(made.p / made.m)
    if written == "momenta":
        found = identify(made.t, q, v * made.m, mass=made.m)
    else:
        found = identify(made.t, text(q, "%.9g"), v=text(v, "%.9g"))
    assert (found.scheme, found.precision) == ("velocity-verlet", "double, stored in single")


@pytest.mark.parametrize("name", ["velocity-verlet", "semi-implicit-euler", "position-verlet", "rk2-heun"])
def test_arithmetic_of_single_precision_is_called_single(name: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(3):
        made = case(name, rng, frames=201, lowest=0.1, width=np.float32)
        mass = made.m.astype(np.float32).astype(np.float64)
        found = identify(made.t, made.q, made.p, mass=mass)
        # without a stiffness the implicit midpoint rule is position Verlet on another spring
        two = {"position-verlet": {name, "implicit-midpoint"}, "rk2-heun": {"rk2-midpoint"}}
        assert schemes(found) == two.get(name, {name}), found
        assert found.precision == "single"
        first = found.candidates[0]
        assert (name in (first.scheme, *first.aliases), first.stride) == (True, 1)
        assert first.stiffness == pytest.approx(made.k, rel=1e-4)


@pytest.mark.parametrize("name", STEPPING)
def test_text_of_six_digits_is_enough_to_name_a_scheme(name: str) -> None:
    made = case(name, np.random.default_rng(3), stride=2, lowest=0.4)
    found = identify(made.t, text(made.q), text(made.p), **made.names)
    assert right(found, name, made), found
    assert (found.precision, found.fits) == ("text, 6 digits", True)
    assert ": rounding to 6 digits explains every step" in found.statement


def test_text_with_a_fixed_number_of_decimals_is_seen() -> None:
    made = case("velocity-verlet", np.random.default_rng(8), lowest=0.4)
    size = np.max(np.abs(made.q))
    found = identify(made.t, text(made.q / size, "%.4f"), text(made.p / size / made.m, "%.4f"), mass=1.0)
    assert found.scheme == "velocity-verlet"
    assert found.precision == "text, 4 decimals"


def test_decimals_are_not_taken_for_digits_where_the_largest_number_is_one() -> None:
    # 1.00 has neighbours ten times as far above as below, so two digits look coarser than two decimals are
    for name, x in (("ruth3", 0.031), ("position-verlet", 0.98), ("semi-implicit-euler", 0.19)):
        made = case(name, np.random.default_rng(6), lowest=x, stride=4)
        q, v = made.q / np.max(np.abs(made.q)), made.p / made.m / np.max(np.abs(made.q))
        rate = np.max(np.abs(v))
        found = identify(made.t * rate, np.round(q, 2), v=np.round(v / rate, 2))
        assert "digits" not in found.precision
        assert name in schemes(found)


def test_what_rounding_hides_is_said_and_not_guessed() -> None:
    made = case("rk4", np.random.default_rng(4), lowest=0.02, frames=101)
    x = 0.02 * np.sqrt(made.m / made.k) / made.h
    slow = float(x[0]) * made.h
    t = np.arange(101) * slow
    w = np.sqrt(made.k / made.m)
    q, p = np.cos(w * t[:, None] + 0.4), -made.m * w * np.sin(w * t[:, None] + 0.4)
    found = identify(t, text(q), text(p), mass=made.m)
    assert (found.verdict, found.scheme, found.fits) == ("not told apart", None, True)
    assert {"exact", "rk4"} <= schemes(found)
    assert "explicit-euler" not in schemes(found)
    assert any("no error of a step is visible" in note for note in found.notes)
    assert any("more digits" in note for note in found.notes)


def test_friction_in_the_force_takes_a_step_of_long_substeps_beyond_its_largest_phase() -> None:
    """Without friction Forest & Ruth's phase turns back there: no guess of h w lies on its curve."""
    h, w2, rate, (q, v) = 0.11, (1.33 / 0.11) ** 2, 1.1, (0.7, 2.3)
    states = []
    for _ in range(101):
        states.append((q, v))
        for kind, share in SCHEMES["forest-ruth"].stages:
            c = h * float(number(share, np.longdouble))
            q, v = (q + c * v, v) if kind == "drift" else (q, v - c * (w2 * q + rate * v))
    q_, v_ = np.array(states).T
    found = identify(h * np.arange(101), q_, v=v_)
    assert (found.scheme, found.stride, found.fits) == ("forest-ruth", 1, True)
    assert (found.omega[0], found.friction[0]) == pytest.approx((w2**0.5, rate))


@pytest.mark.campaign
@pytest.mark.parametrize("form", ["single", "text"])
@pytest.mark.parametrize("name", ["rk4", "ruth3", "forest-ruth", "yoshida4"])
def test_a_scheme_of_high_order_in_coarse_numbers_is_named_or_listed_and_never_called_another(
    name: str, form: str
) -> None:
    rng = np.random.default_rng(31)
    named = 0
    for i in range(4):
        made = case(name, rng, stride=1 + 5 * i)
        coarse = {"single": single, "text": text}[form]
        found = identify(made.t, coarse(made.q), coarse(made.p), **made.names)
        assert (name, made.stride) in [(x.scheme, x.stride) for x in found.candidates], found
        assert found.scheme in (name, None)
        # without a stated step what lies between two schemes may fit, and one alone need not be named
        assert found.scheme is None or len(schemes(found)) == 1
        assert (found.verdict == "named") == (found.scheme is not None)
        named += found.scheme == name
    assert named > 0


def test_all_states_together_show_what_pairs_of_them_do_not() -> None:
    # RK4 loses a**3/72 of its area in a step, 1e-8 here, and single precision rounds at 6e-8: an eighth of
    # a rounding in each of 200 frames, which by pairs of them alone would be 2 standard errors
    made = case("rk4", np.random.default_rng(7), frames=201, lowest=0.02)
    x = 0.095
    k = made.m * (x / made.h) ** 2
    q, p = [made.q[0]], [made.p[0]]
    for _ in range(200):
        a, b = step(SCHEMES["rk4"], q[-1], p[-1], h=made.h, m=made.m, force=lambda q, p: -k * q)
        q.append(a)
        p.append(b)
    found = identify(made.t, single(np.array(q)), single(np.array(p)), mass=made.m, stiffness=k)
    assert (found.scheme, found.stride) == ("rk4", 1)


def test_a_name_that_several_share_is_null_in_the_document_with_what_would_tell_them_apart() -> None:
    made = case("position-verlet", np.random.default_rng(33), lowest=0.3)
    document = json.loads(json.dumps(identify(made.t, made.q, made.p, mass=made.m).document()))
    assert (document["verdict"], document["scheme"], document["nearest"]) == ("not told apart", None, None)
    assert (document["stride"], document["step"]) == (1, pytest.approx(made.h))
    assert (document["omega"], document["stiffness"]) == (None, None)
    assert [x["scheme"] for x in document["candidates"]] == ["position-verlet", "implicit-midpoint"]
    assert document["candidates"][0]["stiffness"] == pytest.approx(float(made.k[0]))
    assert any(note.startswith("the data cannot tell these apart") for note in document["notes"])
    assert document["fits"] is True


@pytest.mark.parametrize("width", [np.float64, np.float32])
def test_too_few_frames_to_see_whether_roundings_were_fed_back_are_called_neither(width: type) -> None:
    told = set()
    for seed in range(6):
        made = case("velocity-verlet", np.random.default_rng(seed), frames=7, lowest=0.3, width=width)
        mass = made.m.astype(np.float32).astype(np.float64)
        told.add(identify(made.t, single(made.q), single(made.p), mass=mass).precision)
    wrong = "single" if width is np.float64 else "double, stored in single"
    assert wrong not in told
    assert "single, or double stored in single" in told


def test_friction_that_a_coarse_file_hides_is_said_to_be_possible() -> None:
    m, k, h = np.array([3.7]), np.array([2.9]), 0.31
    q, p = [np.array([1.3])], [np.array([0.9])]
    weak = np.array([1e-10])
    for _ in range(100):
        a, b = step(SCHEMES["langevin-middle"], q[-1], p[-1], h=h, m=m, force=lambda q, p: -k * q, rate=weak)
        q.append(a)
        p.append(b)
    found = identify(np.arange(101) * h, single(np.array(q)), single(np.array(p)), mass=m)
    assert found.scheme == "velocity-verlet"
    assert "langevin-middle without friction" in found.aliases
    note = next(note for note in found.notes if "would not show" in note)
    assert "langevin-middle" in note
    assert 1e-10 < float(note.split()[4]) < 1e-6


def test_the_exact_flow_is_no_scheme_with_an_error() -> None:
    m, k, t = 3.7, 2.9, np.arange(101) * 1.31
    w = np.sqrt(np.longdouble(k) / m)
    q = (1.3 * np.cos(w * t) + 0.9 / (m * w) * np.sin(w * t)).astype(float)
    p = (0.9 * np.cos(w * t) - 1.3 * m * w * np.sin(w * t)).astype(float)
    found = identify(t, q, p, mass=m, stiffness=k)
    assert (found.scheme, found.precision, found.fits) == ("exact", "double", True)
    assert found.stiffness == pytest.approx((k,), rel=1e-12)


@pytest.mark.parametrize("name", ["velocity-verlet", "rk4", "implicit-midpoint", "semi-implicit-euler"])
def test_independent_oscillators_share_one_scheme(name: str) -> None:
    made = case(name, np.random.default_rng(6), n=5, stride=3)
    q, p = np.c_[made.q, np.zeros(101)], np.c_[made.p, np.zeros(101)]
    found = identify(made.t, q, p, mass=[*made.m, 1.0], stiffness=[*made.k, 1.0])
    assert right(found, name, made), found
    assert found.stiffness == pytest.approx(made.k, rel=1e-11)
    assert any("at rest" in note for note in found.notes)


@pytest.mark.parametrize("method", ["DOP853", "LSODA", "RK45"])
def test_an_adaptive_solver_is_not_forced_into_a_scheme(method: str) -> None:
    m, k, t = 3.7, 2.9, np.arange(201) * 0.31
    z = solve_ivp(
        lambda t, z: [z[1] / m, -k * z[0]],
        (0, t[-1]),
        [1.3, 0.9],
        method=method,
        t_eval=t,
        rtol=1e-8,
        atol=1e-10,
    ).y
    found = identify(t, z[0], z[1], mass=m, stiffness=k)
    assert (found.verdict, found.scheme, found.fits, found.nearest) == ("none", None, False, "exact")
    assert found.omega == pytest.approx((np.sqrt(k / m),), rel=1e-5)
    assert "adaptive" in found.statement


@pytest.mark.parametrize("digits", [17, 9])
@pytest.mark.parametrize("c", [0.3, 1.1])
@pytest.mark.parametrize(
    ("share", "velocity"),
    [(0, "the old velocity"), (0.65, "v + 0.65 h a"), (1, "v + h a"), (0.5, ""), (0.3, None)],
)
def test_the_velocity_whose_friction_acts_in_the_second_half_kick_is_named(
    share: float, velocity: str | None, c: float, digits: int
) -> None:
    """Written down most often with the velocity at hand or a predicted one: those were no scheme's maps."""
    q, v, h, m, k, rows = 1.3, 0.4, 0.2, 2.3, 5.1, []
    for _ in range(120):
        rows.append((q, v))
        a = -(k * q + c * v) / m
        q += h * v + h * h / 2 * a
        v += h / 2 * (a - (k * q + c * (v + share * h * a)) / m)
    qs, vs = text(np.array(rows).T, f"%.{digits}g")
    found = identify(h * np.arange(120), qs, v=vs, mass=m)
    place = f" of {velocity} in the second half kick" if velocity else ""
    if velocity is None:
        assert (found.scheme, found.fits) == (None, False)
        return
    assert found.scheme == "velocity-verlet"
    assert f"with {f'explicit friction in the force{place}' if place else 'friction'}:" in found.statement
    # with one half several laws of friction have the map, each at a rate of its own
    friction = c / m if place else np.nan
    assert found.friction == pytest.approx((friction,), rel=1e-12 if digits == 17 else 1e-6, nan_ok=True)


@pytest.mark.parametrize("w", [0.0217, 0.03499, 0.035], ids=["over", "nearly", "critically"])
def test_friction_up_to_the_critical_and_beyond_is_found_at_any_stride(w: float) -> None:
    # gamma h = 0.07, so that w h = 0.035 is critical; two real rates or hardly any phase show a stride badly
    m, h = np.array([3.7]), 0.31
    k = m * (w / h) ** 2
    q, p = np.array([1.3]), np.array([0.9])
    states = [(q, p)]
    for _ in range(100):
        for _ in range(7):
            q, p = step(
                SCHEMES["langevin-middle"],
                q,
                p,
                h=h,
                m=m,
                force=lambda q, p: -k * q,
                rate=np.full(1, 0.07 / h),
            )
        states.append((q, p))
    qs, ps = (np.array([x[i] for x in states], dtype=np.float64) for i in (0, 1))
    found = identify(np.arange(101) * (7 * h), qs, ps, mass=m)
    assert (found.scheme, found.stride, found.precision) == ("langevin-middle", 7, "double")
    assert found.friction[0] * h == pytest.approx(0.07, rel=1e-10)
    assert found.stiffness == pytest.approx(k, rel=1e-9)


def test_motion_that_has_died_down_to_zero_in_single_precision_does_no_harm() -> None:
    made = case("implicit-euler", np.random.default_rng(22), stride=7, lowest=0.9)
    found = identify(made.t, single(made.q), single(made.p), **made.names)
    assert np.all(single(made.q)[-30:] == 0)
    assert (found.scheme, found.stride, found.fits) == ("implicit-euler", 7, True)


def test_leapfrog_velocities_half_a_step_early_or_late_are_said_to_be_so() -> None:
    rng = np.random.default_rng(9)
    early = case("semi-implicit-euler", rng)
    late = case("semi-implicit-euler-drift-kick", rng)
    assert identify(early.t, early.q, early.p, mass=early.m).velocity_offset == -0.5
    assert identify(late.t, late.q, late.p, mass=late.m).velocity_offset == 0.5
    assert any("leapfrog" in name for name in identify(early.t, early.q, early.p, mass=early.m).aliases)


def test_velocities_serve_without_a_mass() -> None:
    made = case("velocity-verlet", np.random.default_rng(10), stride=4)
    found = identify(made.t, made.q, v=made.p / made.m)
    assert right(found, "velocity-verlet", made)
    assert found.stiffness is None
    assert found.omega == pytest.approx(np.sqrt(made.k / made.m), rel=1e-9)


def test_momenta_with_velocities_give_the_mass() -> None:
    made = case("rk4", np.random.default_rng(12), n=2)
    found = identify(made.t, made.q, made.p, v=made.p / made.m)
    assert found.scheme == "rk4"
    assert found.stiffness == pytest.approx(made.k, rel=1e-10)


def test_momenta_alone_leave_symmetric_schemes_alike_and_the_mass_parts_them() -> None:
    made = case("velocity-verlet", np.random.default_rng(13), lowest=0.2)
    alone = identify(made.t, made.q, made.p)
    assert {"velocity-verlet", "position-verlet", "implicit-midpoint", "exact"} <= schemes(alone)
    assert any("give the mass" in note for note in alone.notes)
    # of another mass the implicit midpoint rule has the same map: only the mass parts those two
    with_stiffness = identify(made.t, made.q, made.p, stiffness=made.k)
    assert (with_stiffness.scheme, schemes(with_stiffness)) == (
        None,
        {"velocity-verlet", "implicit-midpoint"},
    )
    assert identify(made.t, made.q, made.p, **made.names).scheme == "velocity-verlet"


def test_position_verlet_and_the_implicit_midpoint_rule_differ_by_the_stiffness_alone() -> None:
    # a/4 of the one is (a/4)/(1 + a/4) of the other, and then all four entries agree
    made = case("implicit-midpoint", np.random.default_rng(14), lowest=0.3)
    free = identify(made.t, made.q, made.p, mass=made.m)
    assert (free.scheme, schemes(free)) == (None, {"position-verlet", "implicit-midpoint"})
    assert any("the stiffness, where known" in note for note in free.notes)
    assert identify(made.t, made.q, made.p, **made.names).scheme == "implicit-midpoint"


def test_a_stated_stiffness_or_step_that_is_wrong_is_refused() -> None:
    made = case("velocity-verlet", np.random.default_rng(15), stride=2, lowest=0.2)
    assert identify(made.t, made.q, made.p, **made.names, step=made.h).fits
    wrong = identify(made.t, made.q, made.p, mass=made.m, stiffness=made.k * (1 + 1e-11))
    assert not wrong.fits
    assert any("stiffness" in note for note in wrong.notes)
    for h in (2 * made.h, 0.7 * made.h):
        other = identify(made.t, made.q, made.p, mass=made.m, step=h)
        assert (other.scheme, other.stride, other.fits) == ("velocity-verlet", 2, False)


@pytest.mark.parametrize(
    ("share", "words"),
    [(0.97, "does not divide the states' interval"), (1 / 3, ", 3 to a frame, no known scheme fits")],
)
def test_a_stated_step_that_is_not_that_of_the_states_is_said_with_its_reason(
    share: float, words: str
) -> None:
    made = case("velocity-verlet", np.random.default_rng(15), lowest=0.2)
    found = identify(made.t, made.q, made.p, mass=made.m, step=share * made.h)
    assert not found.fits
    assert [note for note in found.notes if "the stated step" in note and words in note], found.notes


def test_wrong_units_of_velocity_are_named() -> None:
    made = case("semi-implicit-euler", np.random.default_rng(16), lowest=0.2)
    found = identify(made.t, made.q, made.p, mass=made.m / 10)
    assert not found.fits
    assert "Semi-implicit Euler" in found.statement
    assert "velocities would have to be 0.1 times as large" in found.statement


def test_whole_turns_between_frames_are_counted() -> None:
    made = case("velocity-verlet", np.random.default_rng(17), stride=9, lowest=1.2)
    found = identify(made.t, made.q, made.p, mass=made.m)
    assert right(found, "velocity-verlet", made)
    assert any("whole turns" in note for note in found.notes)


def test_an_equilibrium_away_from_zero_is_found() -> None:
    made = case("velocity-verlet", np.random.default_rng(18), lowest=0.2)
    found = identify(made.t, made.q + 7.25 * np.max(np.abs(made.q)), made.p, mass=made.m)
    assert (found.scheme, found.precision) == ("velocity-verlet", "double")
    assert found.stiffness == pytest.approx(made.k, rel=1e-10)


def test_times_that_fall_are_steps_back_in_time_or_frames_in_reverse_order() -> None:
    made = case("semi-implicit-euler", np.random.default_rng(19), lowest=0.2)
    found = identify(-made.t[::-1], made.q[::-1], made.p[::-1], mass=made.m)
    assert found.scheme != "semi-implicit-euler"
    states = made.t[::-1], made.q[::-1], made.p[::-1]
    either = identify(*states, mass=made.m)
    assert (either.verdict, either.scheme, either.fits) == ("not told apart", None, True)
    assert {x.scheme for x in either.candidates} == {
        "semi-implicit-euler",
        "semi-implicit-euler-drift-kick",
    }
    back = identify(*states, mass=made.m, step=-either.candidates[-1].step)
    assert (back.scheme, back.step < 0) == ("semi-implicit-euler-drift-kick", True)
    turned = identify(*states, mass=made.m, step=either.candidates[-1].step)
    assert (turned.scheme, turned.step > 0) == ("semi-implicit-euler", True)


@pytest.mark.parametrize("name", ["velocity-verlet", "semi-implicit-euler"])
def test_coarse_forces_are_told_from_coarse_states(name: str) -> None:
    m, k, h = np.array([3.7]), np.array([2.9]), 0.31

    def run(force: Force) -> Identification:
        q, p = [np.array([1.3])], [np.array([0.9])]
        for _ in range(200):
            a, b = step(SCHEMES[name], q[-1], p[-1], h=h, m=m, force=force)
            q.append(a)
            p.append(b)
        return identify(h * np.arange(201), np.array(q), np.array(p), mass=m)

    fixed = run(lambda q, p: np.rint(-k * q * 2.0**32) / 2.0**32)
    mixed = run(lambda q, p: (-k * q).astype(np.float32).astype(np.float64))
    assert (fixed.scheme, fixed.precision, fixed.fits) == (name, "fixed-point force", True)
    assert (mixed.scheme, mixed.precision, mixed.fits) == (name, "mixed", True)
    # irregular, but of no quanta that an arithmetic has
    neither = run(lambda q, p: -k * q * (1 + 1e-11 * np.sin(1e6 * q)))
    assert (neither.scheme, neither.fits) == (None, False)
    assert "Noise" in neither.statement


def test_anharmonic_motion_is_called_so_and_coupled_motion_judged_by_its_modes() -> None:
    scheme, m = SCHEMES["velocity-verlet"], np.array([1.3, 0.7])
    runs = {
        "anharmonic": lambda q, p: -2.1 * q**3,
        "coupled": lambda q, p: -2.1 * q + 0.8 * (q[::-1] - q),
    }
    for word, force in runs.items():
        q, p = [np.array([1.1, -0.4])], [np.array([0.4, 0.3])]
        for _ in range(100):
            a, b = step(scheme, q[-1], p[-1], h=0.07, m=m, force=force)
            q.append(a)
            p.append(b)
        found = identify(0.07 * np.arange(101), np.array(q), np.array(p), mass=m)
        assert found.fits == (word == "coupled")
        assert word in " ".join([found.statement, *found.notes])
        assert found.scheme == ("velocity-verlet" if word == "coupled" else None)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: (c.t[:4], c.q[:4], c.p[:4]), "too few"),
        (lambda c: (c.t, 0 * c.q, 0 * c.p), "nothing moves"),
        (lambda c: (c.t**1.01, c.q, c.p), "constant interval"),
        (lambda c: (0 * c.t, c.q, c.p), "times are equal"),
        (lambda c: (c.t, np.where(c.t[:, None] > c.t[7], np.nan, c.q), c.p), "frame 8"),
        (lambda c: (c.t, c.q[:-1], c.p), "shape"),
        (lambda c: (c.t, np.hstack([c.q, c.q]), c.p), r"shape \(101, 2\), .* \(101, 1\): they must agree"),
        (
            lambda c: (c.t, 1e-200 * c.q, 1e-200 * c.p),
            "positions are of the size .*e-201: give",
        ),
        (lambda c: (c.t, 1e200 * c.q, 1e200 * c.p), "positions are of the size .*e.199: give"),
        (lambda c: (1e-200 * c.t, c.q, 1e200 * c.p), "times are of the size .*e-20"),
        (lambda c: (c.t, c.q, 1e-100 * c.p), "velocities times the interval are of the size"),
        (lambda c: (c.t, c.t[:, None] * 0.3 + 1, 0 * c.p + 0.3 * c.m), "straight line"),
        (lambda c: (c.t, c.q[0] * (-1.0) ** np.arange(101)[:, None], 0 * c.p), "velocities .* do not change"),
    ],
)
def test_states_that_cannot_show_a_map_are_refused_with_a_reason(change, words: str) -> None:
    made = case("velocity-verlet", np.random.default_rng(20))
    t, q, p = change(made)
    with pytest.raises(IdentificationError, match=words):
        identify(t, q, p, mass=made.m)


def test_momenta_of_few_digits_ask_for_the_mass() -> None:
    made = case("velocity-verlet", np.random.default_rng(13), lowest=0.2)
    found = identify(made.t, text(made.q), text(made.p))
    assert found.verdict == "not told apart"
    told = [note for note in found.notes if note.startswith("what would tell them apart: ")]
    assert [note.endswith(" or the mass") for note in told] == [True]


def test_momenta_that_point_against_their_velocities_give_no_mass() -> None:
    made = case("velocity-verlet", np.random.default_rng(20))
    with pytest.raises(IdentificationError, match="opposite ways: one of them is wrong"):
        identify(made.t, made.q, made.p, v=-made.p / made.m)


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"stiffness": np.nan}, "stiffness nan"),
        ({"friction": np.inf}, "friction inf"),
        ({"step": 0.0}, "step 0"),
        ({"step": 1e-19}, "step 1e-19: .* of them to a frame are more than the times can tell"),
        ({"mass": 1e-90}, "mass 1e-90"),
        ({"stiffness": [1.0, 2.0]}, "stiffness of shape"),
    ],
)
@pytest.mark.parametrize("alone", [False, True])
def test_what_is_stated_is_a_number_of_a_size_or_refused(stated, words: str, alone: bool) -> None:
    made = case("velocity-verlet", np.random.default_rng(20))
    with pytest.raises(IdentificationError, match=words):
        identify(made.t, made.q[:, 0], v=None if alone else made.p[:, 0], **stated)


def test_the_document_is_json_with_the_fields_of_the_command() -> None:
    made = case("velocity-verlet", np.random.default_rng(21))
    found = identify(made.t, made.q, made.p, mass=made.m)
    document = json.loads(json.dumps(found.document(), allow_nan=False))
    wanted = {"scheme", "aliases", "step", "stride", "omega", "stiffness", "velocity_offset", "determinant"}
    wanted |= {"symplectic_defect", "defect_ulp", "precision", "fits", "nearest", "notes"}
    assert wanted <= set(document)
    assert document["stiffness"] == pytest.approx(float(made.k[0]))
    with pytest.raises(IdentificationError, match="mass -1: one number of a size from"):
        identify(made.t, made.q, made.p, mass=-1.0)


def test_a_damped_spring_that_has_the_very_same_map_is_said_until_the_stiffness_excludes_it() -> None:
    """Implicit Euler of k is semi-implicit Euler of k/(1 + a) with a friction c/m of h k/m/(1 + a)."""
    k, m, h, q, v = 2.9, 1.3, 0.31, 1.1, 0.4
    a, rows = k / m * h * h, []
    for _ in range(101):
        rows.append((q, v))
        v = (v - h * k / m * q) / (1 + a)
        q += h * v
    x, u = np.array(rows).T
    found = identify(h * np.arange(101), x, v=u, mass=m)
    assert (found.scheme, found.aliases) == ("implicit-euler", ("semi-implicit-euler with friction",))
    other = f"stiffness {k / (1 + a):.9g} and friction c/m {h * k / m / (1 + a):.6g}: the stiffness"
    assert [other in note for note in found.notes if note.startswith("the same map is")] == [True]
    stated = identify(h * np.arange(101), x, v=u, mass=m, stiffness=k)
    assert not any(note.startswith("the same map is") for note in stated.notes)


def spring(name: str, *, k: float = 2.9, frames: int = 61) -> tuple[Floats, Floats, Floats]:
    """Times, positions and momenta of a scheme on one spring, of mass 3.7."""
    states = [(np.array([1.3]), np.array([0.9]))]
    for _ in range(frames - 1):
        q, p = step(SCHEMES[name], *states[-1], h=0.31, m=np.array([3.7]), force=lambda q, p: -k * q)
        states.append((np.asarray(q, np.float64), np.asarray(p, np.float64)))
    q, p = (np.concatenate(x) for x in zip(*states, strict=True))
    return 0.31 * np.arange(frames), q, p


@pytest.mark.parametrize(
    ("name", "k", "note"),
    [
        ("semi-implicit-euler", 2.9, "leapfrog with velocities half a step early: states alone do not tell"),
        ("semi-implicit-euler-drift-kick", 2.9, "leapfrog with velocities half a step late: states alone do"),
        ("velocity-verlet", -0.3, "the spring is inverted: its stiffness is negative"),
        ("velocity-verlet", 2.9, None),
    ],
)
def test_what_is_peculiar_to_a_scheme_or_a_spring_stands_beside_its_name(
    name: str, k: float, note: str | None
) -> None:
    t, q, p = spring(name, k=k)
    found = identify(t, q, p, mass=3.7)
    assert (found.scheme, found.stiffness) == (name, pytest.approx((k,)))
    assert [note is not None and note in one for one in found.notes] == ([True] if note else [])


@pytest.mark.parametrize(
    ("q", "v", "note"),
    [
        (lambda t: 0.3 + 0.4 * t, lambda t: 0.4 + 0 * t, "1 moves freely, in a straight line"),
        (lambda t: 0.3 + 0.4 * t - 0.6 * t * t, lambda t: 0.4 - 1.2 * t, "1 moves by a constant force alone"),
        (lambda t: (-1.0) ** np.arange(len(t)), lambda t: 0 * t + 1e-30, "1 shows too little of its motion"),
    ],
)
def test_a_coordinate_that_shows_no_scheme_is_left_out_and_said_to_be(
    q: Callable[[Floats], Floats], v: Callable[[Floats], Floats], note: str
) -> None:
    t, x, p = spring("velocity-verlet")
    found = identify(t, np.stack([x, q(t)], axis=1), v=np.stack([p / 3.7, v(t)], axis=1), mass=3.7)
    assert found.scheme == "velocity-verlet"
    assert [f"oscillator {note}" in one and "is left out" in one for one in found.notes] == [True]


def test_a_fall_alone_is_refused_and_has_no_spring() -> None:
    """It was an inverted spring of a stiffness of 1e-12, by one of all schemes."""
    t = 0.0279 * np.arange(120)
    with pytest.raises(IdentificationError, match="no force acts on oscillator 0 but a constant one"):
        identify(t, 1.0 + 0.3 * t + 0.2 * t * t, v=0.3 + 0.4 * t)


def test_a_coordinate_in_a_straight_line_whose_velocities_alternate_does_not_move_freely() -> None:
    """Their mean is the line's slope to the last bit."""
    t, x, p = spring("velocity-verlet", frames=60)
    q, v = 0.3 + 0.4 * t, 0.4 + 0.1 * (-1.0) ** np.arange(60)
    found = identify(t, np.stack([x, q], axis=1), v=np.stack([p / 3.7, v], axis=1), mass=3.7)
    assert found.scheme is None
    assert not any("moves freely" in note for note in found.notes)


def test_velocities_that_are_all_0_are_refused_in_a_line() -> None:
    t, x, _ = spring("velocity-verlet")
    with pytest.raises(IdentificationError, match="oscillator 0 do not change while its positions do"):
        identify(t, np.stack([x, x[::-1]], axis=1), v=np.zeros((61, 2)), mass=3.7)


def test_momenta_alone_are_said_to_leave_three_numbers_of_a_map() -> None:
    """Of momenta without a mass the scale is free, and with it the difference of these schemes."""
    t, q, p = spring("velocity-verlet", frames=21)
    said = "neither mass nor velocities nor stiffness are known, so only three numbers of each map count"
    found, stated = identify(t, q, p), identify(t, q, p, stiffness=2.9)
    assert {"velocity-verlet", "position-verlet", "exact"} <= {x.scheme for x in found.candidates}
    assert {x.scheme for x in stated.candidates} == {"velocity-verlet", "implicit-midpoint"}
    assert [any(said in note for note in x.notes) for x in (found, stated)] == [True, False]


def test_aliases_are_the_schemes_with_the_same_matrix() -> None:
    assert aliases("implicit-midpoint") == ("trapezoidal",)
    assert aliases("rk2-heun") == ("rk2-midpoint",)
    assert aliases("velocity-verlet") == ()


def heun(q, p, h, force, mass):
    a, b = p / mass, force(q)
    c, d = (p + h * b) / mass, force(q + h * a)
    return q + h / 2 * (a + c), p + h / 2 * (b + d)


def massless(q, p, h, force, mass):
    p = p + h * force(q)
    return q + h * p, p


def forwards_only(q, p, h, force, mass):
    h = abs(h)
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return q, p + h / 2 * force(q)


def linear_only(q, p, h, force, mass):
    """RK4 on a spring: the derivatives are taken as if the force were linear."""
    a, v = force(q) / mass, p / mass
    j, s = force(v) / mass, force(a) / mass
    return (
        q + h * v + h**2 / 2 * a + h**3 / 6 * j + h**4 / 24 * s,
        p + mass * (h * a + h**2 / 2 * j + h**3 / 6 * s + h**4 / 24 * force(j) / mass),
    )


def in_place(q, p, h, force, mass):
    p[0] += h * force(q)[0]
    q[0] += h * p[0] / mass[0]
    return q, p


def test_a_stepper_is_named_and_its_order_seen_on_an_anharmonic_well() -> None:
    found = identify_stepper(heun)
    assert ("rk2-heun" in (found.scheme, *found.aliases), found.fits) == (True, True)
    assert any(note.startswith("order 2.0") for note in found.notes)
    assert identify_stepper(in_place).scheme == "semi-implicit-euler"


def a_kick_too_long(q, p, h, force, mass):
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return q, p + h * force(q)


def heavy_weights(q, p, h, force, mass):
    def rates(q, p):
        return p / mass, force(q)

    k, weights = [rates(q, p)], (1, 2, 3, 1)
    for c in (0.5, 0.5, 1.0):
        k.append(rates(q + c * h * k[-1][0], p + c * h * k[-1][1]))
    return tuple(
        x + h / 6 * sum(w * y[i] for w, y in zip(weights, k, strict=True)) for i, x in enumerate((q, p))
    )


@pytest.mark.parametrize(
    ("stepper", "words"),
    [
        (a_kick_too_long, "the momentum changes by 1.5 h F and the position by 1 h p/m"),
        (heavy_weights, "the momentum changes by 1.1667 h F and the position by 1.1667 h p/m"),
        (massless, "mass is left out"),
        (forwards_only, "negative step goes forwards"),
        (linear_only, "not on forces that are not linear"),
    ],
)
def test_a_stepper_with_a_fault_is_told_which(stepper, words: str) -> None:
    found = identify_stepper(stepper)
    assert not found.fits
    assert words in found.statement, found


def test_a_stepper_that_draws_is_named_from_more_states_than_a_map_needs() -> None:
    rng = np.random.default_rng(1)

    def baoab(q, p, h, force, mass):
        c = np.exp(-0.5 * h)
        p = p + h / 2 * force(q)
        q = q + h / 2 * p / mass
        p = c * p + np.sqrt(0.47 * mass * (1 - c * c)) * rng.standard_normal()
        q = q + h / 2 * p / mass
        return q, p + h / 2 * force(q)

    found = identify_stepper(baoab)
    assert "baoab" in [one.scheme for one in found.candidates]
    (told,) = [note for note in found.notes if note.startswith("baoab: ")]
    thermal, error = (float(x) for x in told.partition("kT ")[2].split(" +- "))
    assert abs(thermal - 0.47) < 5 * error


def test_a_stepper_that_is_not_there_or_fails_is_one_clear_line(tmp_path, monkeypatch) -> None:
    (tmp_path / "mine_7f3.py").write_text(
        "import math\ndef good(q, p, h, force, mass):\n    return q, p\nx = 3\n"
    )
    monkeypatch.chdir(tmp_path)
    assert callable(load("mine_7f3:good"))
    assert callable(load("mine_7f3.py:good"))
    for spec, words in (
        ("mine_7f3", "module:function"),
        ("nowhere_7f3:f", "no module"),
        ("mine_7f3:bad", "it has good"),
        ("mine_7f3.py:bad", "it has good"),
        ("nowhere_7f3.py:f", "no such file"),
        ("mine_7f3:x", "not a function"),
    ):
        with pytest.raises(MethodError, match=words):
            load(spec)
    with pytest.raises(MethodError, match="returns"):
        identify_stepper(lambda q, p, h, force, mass: 3.0)
    with pytest.raises(MethodError, match="nothing moves"):
        identify_stepper(load("mine_7f3:good"))


@pytest.mark.parametrize(
    ("precision", "words"),
    [
        ("double", "double arithmetic"),
        ("double, stored in single", "double arithmetic, stored in single,"),
        ("text, 6 digits and text, 3 decimals", "rounding to 6 digits and 3 decimals"),
        (UNTOLD, "rounding"),
    ],
)
def test_what_rounds_the_states_is_said_in_words(precision: str, words: str) -> None:
    assert rounded_by(precision) == words
