"""Requirements of checks, each with the sentence that says what is missing.

A subject is a `Case` or a `Bench`; both have a scene, a scheme and a `law`.  Requirements are tested in the
order of this table, so each may rely on those before it that a check requires as well.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.checks.bench import LARGEST
from springcheck.physics import exact
from springcheck.physics.system import MOST_JOINED

CONTRACTED = 1e-3
"""Determinant of a step below which its powers are not formed, as differences of products, and the angle of a
run below which two eigenvalues are not told apart: 3 of the 19 digits of the reference are lost there."""

Lacks: TypeAlias = Callable[[Any], str | None]
"""A subject -> why the requirement is not met, or None."""


class Requirement(NamedTuple):
    """One row: its name, its phrase in `list` and `explain`, and why a subject does not meet it."""

    name: str
    word: str
    lacks: Lacks


def _unless(has: Callable[[Any], bool], otherwise: str) -> Lacks:
    """`otherwise`, with the {title} of the scheme in it, unless the subject has what is required."""
    return lambda subject: None if has(subject) else otherwise.format(title=subject.scheme.title)


def _trait(name: schemes.Trait, otherwise: str) -> Lacks:
    return _unless(lambda subject: subject.law.has(name), otherwise)


def _unsolved(subject: Any) -> str | None:
    why = exact.no_reference(subject.scene)
    return f"no reference solution, because {why}" if why else None


def _too_long(subject: Any) -> str | None:
    """An implicit step so long that neither engine nor reference keeps a digit of it."""
    if not subject.scheme.has("implicit"):
        return None
    scene = subject.law.scene
    w = np.sqrt(np.max(scene.system.gershgorin(scene.q.astype(np.longdouble)) / scene.m))
    turn = float(abs(scene.step) * w)
    return None if turn < 2.0**53 else f"a step of h w = {turn:.1e} is beyond the digits of a double"


def _no_phase(case: Any) -> str | None:
    modes = case.system.modes
    lost = case.system.norm.most(modes.blur, 0 * modes.w2) > case.growth[1][-1]
    if lost or np.any((modes.w2 == 0) & (modes.pull != 0)):
        return "a mode under a constant force has no analytic solution here"
    determinant = schemes.rotation(case.law.propagator).determinant
    if not np.all(np.isfinite(determinant)):
        return "the equation of an implicit step has no solution here"
    if np.any(determinant <= 0):
        return "the step reverses orientation (det <= 0): it has no phase"
    if np.any(determinant < CONTRACTED):
        return "friction contracts area more in one step than the reference has digits for"
    products = np.abs(case.law.propagator[:, 0, 0] * case.law.propagator[:, 1, 1])
    if not case.area_preserving and np.any(products * CONTRACTED > determinant):
        return "what a step leaves of an area is a difference that the reference has no digits for"
    return None


def _no_answer(case: Any) -> str | None:
    """Why the discrete response to driving forces has no closed form here."""
    alone = case.undriven
    if alone is case:
        return None
    if case.scheme.has("flow") or case.steps[0] != 0:
        return "the response to a drive is known only for schemes that evaluate forces, and from step 0 on"
    found = schemes.rotation(alone.law.propagator)
    if case.sums_steps:
        return "the discrete response to a drive is known for times n h, and these times are running sums"
    if np.any(np.maximum(found.near, found.growth) * case.steps[-1] < CONTRACTED):
        return "a driven mode that neither oscillates nor grows has no analytic solution here"
    return None


_ALL = (
    Requirement("start", "the first frame", _unless(
        lambda case: not case.piece or case.steps[0] == 0, "this piece does not hold the start")),
    Requirement("three-dimensions", "an engine in three dimensions", _unless(
        lambda x: x.trajectory.off_axis is not None,
        "the engine is given coordinates, not points in space")),
    Requirement("energies", "recorded energies", _unless(
        lambda case: case.trajectory.energy is not None, "the scene keeps no energies")),
    Requirement("unheld", "no fixed particle", _unless(
        lambda x: all(term.bodies > 1 for term in x.scene.terms),
        "walls and fixed potentials take up momentum")),
    Requirement("driven", "a force that depends on the time", _unless(
        lambda x: x.scene.system.is_driven, "no force depends on the time")),
    Requirement("alike", "two axes with equal springs", _unless(
        lambda x: bool(x.scene.system.alike), "no two axes are alike, about 0 and by linear springs")),
    Requirement("named", "a scheme that is named", _trait(
        "named", "its scheme is not known; --scheme NAME states it")),
    Requirement("one-step", "a fixed step", _trait(
        "one-step", "it has no step of stages; an adaptive solver is judged by its tolerance")),
    Requirement("tolerance", "a tolerance", _unless(
        lambda x: not x.law.has("one-step") and x.trajectory.tolerance is not None,
        "a method of fixed step has no tolerance")),
    Requirement("convergence", "a known law of its tolerance", _unless(
        lambda x: x.scheme.convergence is not None, "no law is known for {title}")),
    Requirement("every-step", "every step recorded", _unless(
        lambda case: case.trajectory.every == 1 and len(case.trajectory.t) > 4,
        "states further apart than a step, or fewer than five, leave no draw that can be identified")),
    Requirement("two-frames", "two frames", _unless(
        lambda case: len(case.trajectory.t) > 1, "there is no second frame")),
    Requirement("solution", "a reference solution", _unsolved),
    Requirement("autonomous", "forces that do not depend on the time", _unless(
        lambda x: not x.scene.system.is_driven,
        "a force depends on the time: going back meets another one")),
    Requirement("undamped", "no friction", _trait(
        "undamped", "friction contracts area and lets a phase decay, and going back does not undo it")),
    Requirement("one-area", "modes that lose area at one rate", _unless(
        lambda x: x.area_preserving or x.scene.system.is_separate,
        "modes that lose area at rates of their own share it")),
    Requirement("explicit", "an explicit scheme", _trait(
        "explicit", "what is solved, or exponentiated, may round otherwise")),
    Requirement("splitting", "a splitting", _trait(
        "splitting", "only a splitting keeps a shadow energy that its own arithmetic does not solve for")),
    Requirement("symplectic", "a symplectic scheme", _trait(
        "symplectic", "{title} does not claim to be symplectic")),
    Requirement("reversible", "a reversible scheme", _unless(
        lambda x: x.scheme.has("reversible") or len(x.scheme.stages) == 2,
        "{title} is not its own adjoint: only another scheme undoes its steps")),
    Requirement("double", "double precision", _unless(
        lambda x: not x.trajectory.arithmetic.quantum and x.trajectory.arithmetic.is_double,
        "the rounding of its forces hides that of its steps")),
    Requirement("linear", "a linear scene", _trait(
        "linear", "an anharmonic or driven step is no matrix; step-defect judges it")),
    Requirement("unmixed", "springs that act at the same time", _unless(
        lambda x: not x.law.has("mixes"),
        "slow and fast springs act at different times: no normal mode stays by itself")),
    Requirement("modes", "normal modes", _unless(
        lambda x: x.scene.system.has_modes,
        "no analytic solution of the scheme: the scene is anharmonic or driven, or friction "
        f"couples its modes, or more than {MOST_JOINED} particles are joined")),
    Requirement("few", f"{LARGEST} particles at most", _unless(
        lambda x: x.scene.n <= LARGEST, f"of more than {LARGEST} particles the step defect says as much")),
    Requirement("resolved", "a step that double precision resolves", _too_long),
    Requirement("phase", "a step that oscillates", _no_phase),
    Requirement("closed", "normal modes and a step that oscillates, driven or not", lambda case: (
        missing(case.undriven, {"modes", "phase"}) or _no_answer(case))),
)  # fmt: skip

REQUIREMENTS = {one.name: one for one in _ALL}

MAP = frozenset({"named", "one-step", "two-frames"})
"""Requirements of a check of recorded steps."""

CLOSED = MAP | {"unmixed", "modes", "phase"}
"""Requirements of the closed form of the discrete motion."""


def missing(subject: Any, requires: Collection[str]) -> str | None:
    """Why a check of these requirements does not apply to a subject, or None."""
    reasons = (one.lacks(subject) for one in _ALL if one.name in requires)
    return next((reason for reason in reasons if reason), None)
