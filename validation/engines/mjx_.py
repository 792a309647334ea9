"""MJX, MuJoCo written in JAX, with x64 switched on: the spring of a slide joint."""

from functools import cache
from typing import Any

from springs import Springs, methods

from springcheck.engines import Engine

MODEL = """<mujoco><option timestep="{h!r}" integrator="{integrator}" gravity="0 0 0">
<flag contact="disable"/></option><worldbody><body>
<joint type="slide" axis="1 0 0" stiffness="{k!r}" springref="{at!r}"/>
<geom size="0.1" mass="{m!r}"/></body></worldbody></mujoco>"""

INTEGRATORS = {"euler": "Euler", "rk4": "RK4", "implicitfast": "implicitfast"}


@cache
def compiled() -> Any:
    """A step, compiled once: a step's length and a spring are numbers of the model."""
    import jax
    from mujoco import mjx

    jax.config.update("jax_enable_x64", True)
    return jax.jit(mjx.step)


def start(scene: Any, method: Any, label: Any, step: float) -> Springs:
    """A run."""
    import jax
    import mujoco
    from mujoco import mjx

    move = compiled()

    def spring(m: float, k: float, at: float, q: float, v: float, h: float) -> Any:
        text = MODEL.format(h=h, integrator=INTEGRATORS[method.name], k=k, at=at, m=m)
        model = mjx.put_model(mujoco.MjModel.from_xml_string(text))
        data = mjx.make_data(model).replace(qpos=jax.numpy.array([q]), qvel=jax.numpy.array([v]))

        def step() -> tuple[float, float]:
            nonlocal data
            data = move(model, data)
            return float(data.qpos[0]), float(data.qvel[0])

        return step

    return Springs(scene, step, spring)


def version() -> dict[str, str]:
    """Versions of MJX and JAX."""
    from importlib.metadata import version as of

    return {"mujoco-mjx": of("mujoco-mjx"), "jax": of("jax")}


ENGINE = Engine(
    name="mjx", title="MJX", distribution="mujoco-mjx", module="mujoco.mjx",
    methods=methods(
        euler=("semi-implicit-euler", "a slide joint's stiffness, Euler"),
        rk4=("rk4", "a slide joint's stiffness, RK4"),
        implicitfast=("semi-implicit-euler", "a slide joint's stiffness, implicitfast"),
    ),
    start=start, version=version,
)  # fmt: skip
