"""MuJoCo: bodies on slide joints along x, their springs given to joints, to tendons or to a motor.

How a spring is attached decides the scheme.  Joint and tendon springs are evaluated by MuJoCo at the
positions of each step; a motor's force is ours, and it stays what it is until it is set again: over the
stages of RK4, and over the substeps of a frame (`frame_skip`).  Joint damping is implicit in the velocity
unless that is switched off.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from springcheck.engines.contract import (
    EVERY_FORCE,
    SPRINGS,
    Engine,
    Label,
    Method,
    Need,
    Stopped,
    by_name,
    named,
    version_of,
)
from springcheck.errors import MethodError
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Spring, WallSpring

DAMPED = SPRINGS | {"damping"}

IMPLICIT_FRICTION = "semi-implicit-euler-implicit-friction"


INTEGRATORS = {
    "joint-spring-implicit": "IMPLICIT", "joint-spring-implicitfast": "IMPLICITFAST",
    "joint-spring-rk4": "RK4", "joint-damping-implicitfast": "IMPLICITFAST", "motor-rk4": "RK4",
}  # fmt: skip
"""MuJoCo's integrator of a method, where it is not Euler's."""

SUBSTEPS = {"motor-frame-skip-5": 5}
"""Steps of MuJoCo in one of a method; of all others 1."""


def _model(mujoco: Any, scene: Scene, label: Label, step: float) -> Any:
    """A body for each particle, on a slide, and what pulls it."""
    name, motor = label.method, _has_motor(label)
    spec = mujoco.MjSpec()
    spec.option.timestep = step / SUBSTEPS.get(name, 1)
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{INTEGRATORS.get(name, 'EULER')}")
    # beyond 1e10 MuJoCo would set the state back to the start of the model, and go on
    flags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if name == "joint-damping-explicit":
        flags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    spec.option.disableflags = int(flags)
    slide, joints = mujoco.mjtJoint.mjJNT_SLIDE, []
    for i, mass in enumerate(scene.m.tolist()):
        body = spec.worldbody.add_body(name=f"b{i}", mass=mass, ipos=[0.0] * 3, inertia=[1.0] * 3)
        body.explicitinertial = True
        joints.append(body.add_joint(name=f"j{i}", type=slide, axis=[1.0, 0.0, 0.0]))
        if motor:
            actuator = spec.add_actuator(name=f"m{i}", target=f"j{i}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
            actuator.set_to_motor()
    if not motor:
        _springs(spec, joints, scene)
    return spec.compile()


def _springs(spec: Any, joints: list[Any], scene: Scene) -> None:
    """Springs to walls as joint springs, the first of each joint, and all others as springs of tendons."""
    taken: set[int] = set()
    for term in scene.terms:
        if isinstance(term, Damping):
            for i, c in term.rows():
                joints[i].damping = _first(joints[i].damping, c)
        elif isinstance(term, WallSpring):
            for i, k, at in term.rows():
                if i in taken:
                    _tendon(spec, {i: 1.0}, k, at)
                    continue
                taken.add(i)
                joints[i].stiffness, joints[i].springref = _first(joints[i].stiffness, k), at
        elif isinstance(term, Spring):
            for a, b, k, rest in term.rows():
                _tendon(spec, {a: -1.0, b: 1.0}, k, rest)


def _first(field: Any, value: float) -> Any:
    """A coefficient in the shape of its field: a number, or from 4.0 on a polynomial's."""
    if np.ndim(field) == 0:
        return field + value
    return [field[0] + value, *field[1:]]


def _tendon(spec: Any, joints: Mapping[int, float], k: float, rest: float) -> None:
    tendon = spec.add_tendon()
    tendon.stiffness = _first(tendon.stiffness, k)
    # MuJoCo takes -1 for the length at the start
    tendon.springlength = [abs(rest), abs(rest)]
    for i, coefficient in joints.items():
        tendon.wrap_joint(f"j{i}", -coefficient if rest < 0 else coefficient)


class _Steps:
    """MuJoCo's model and data in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        import mujoco

        if (least := float(np.min(scene.m))) < mujoco.mjMINVAL:
            raise MethodError(
                f"{label}: MuJoCo takes no mass below {mujoco.mjMINVAL:g}, and one is {least:g}"
            )
        self.force_calls = 0
        self._step = mujoco.mj_step
        # MuJoCo would write its warnings to a file in the current folder; the states show what it warns of
        mujoco.set_mju_user_warning(lambda message: None)
        self._model = _model(mujoco, scene, label, step)
        self._data = mujoco.MjData(self._model)
        self._q, self._v, self._control = self._data.qpos, self._data.qvel, self._data.ctrl
        self._q[:], self._v[:] = scene.q, scene.p / scene.m
        self._m = scene.m
        self._force = scene.system.force if _has_motor(label) else None
        self._substeps = SUBSTEPS.get(method.name, 1)
        self._bad_control = int(mujoco.mjtWarning.mjWARN_BADCTRL)
        self._each = 4 if method.name == "joint-spring-rk4" else 1

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        step, model, data, v_now, q_now = self._step, self._model, self._data, self._v, self._q
        dropped = data.warning[self._bad_control :]
        with np.errstate(over="ignore", invalid="ignore"):
            for row in range(len(q)):
                self.force_calls += every * self._each
                if self._force is None:
                    step(model, data, every)
                else:
                    for _ in range(every):
                        self._control[:] = self._force(q_now, v_now * self._m)
                        step(model, data, self._substeps)
                    if dropped[0].number:
                        p[:row] *= self._m
                        raise Stopped(row, "MuJoCo sets controls beyond 1e10 to 0", is_limit=True)
                q[row] = q_now
                p[row] = v_now
            p *= self._m


def arithmetic(label: Label) -> Arithmetic:
    """Double precision; MuJoCo takes no control beyond 1e10."""
    return Arithmetic(overflow=1e10) if _has_motor(label) else Arithmetic()


def _has_motor(label: Label) -> bool:
    """Whether a motor applies the force, which springcheck computes."""
    return label.method.startswith("motor")


ENGINE = Engine(
    name="mujoco",
    title="MuJoCo",
    reference="E. Todorov, T. Erez, Y. Tassa, MuJoCo, IROS 2012, 5026, doi:10.1109/IROS.2012.6386109",
    distribution="mujoco",
    extra="mujoco",
    methods=named(
        by_name("joint-spring", "semi-implicit-euler", "joint stiffness, integrator Euler", SPRINGS),
        by_name("joint-spring-implicit", "semi-implicit-euler", "joint stiffness, implicit", SPRINGS,
            note="differs from Euler by velocity-dependent forces only"),
        by_name("joint-spring-implicitfast", "semi-implicit-euler", "joint stiffness, implicitfast", SPRINGS,
            note="differs from Euler by velocity-dependent forces only"),
        by_name("joint-spring-rk4", "rk4", "joint stiffness and damping, RK4", DAMPED),
        by_name("joint-damping", IMPLICIT_FRICTION, "joint damping, integrator Euler", DAMPED, Need.DAMPING),
        by_name(
            "joint-damping-implicitfast", IMPLICIT_FRICTION, "joint damping, implicitfast", DAMPED,
            Need.DAMPING,
        ),
        by_name(
            "joint-damping-explicit", "semi-implicit-euler", "joint damping, eulerdamp off", DAMPED,
            Need.DAMPING,
        ),
        by_name("motor", "semi-implicit-euler", "force by a motor, set at every step, Euler", EVERY_FORCE),
        by_name("motor-rk4", "force-held-rk4", "force by a motor, set at every step, RK4", EVERY_FORCE),
        by_name(
            "motor-frame-skip-5", "force-held-5", "force by a motor, one for 5 substeps of h/5", EVERY_FORCE,
            note="documented: a control is constant for the whole call; mujoco#1891"),
    ),
    start=_Steps,
    version=version_of("mujoco"),
    arithmetic=arithmetic,
    squares_lengths=True,
    convention=lambda method: "velocities of the joints, synchronised",
)  # fmt: skip
