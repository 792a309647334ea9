"""jax-md, with x64 switched on: its nve by a force."""

from typing import Any

from springs import Springs, methods

from springcheck.engines import Engine


def start(scene: Any, method: Any, label: Any, step: float) -> Springs:
    """A run."""
    import jax
    import numpy as np
    from jax_md import simulate, space

    jax.config.update("jax_enable_x64", True)

    def spring(m: float, k: float, at: float, q: float, v: float, h: float) -> Any:
        _, shift = space.free()
        begin, move = simulate.nve(lambda x, **_: -k * (x - at), shift, dt=h)
        state = begin(jax.random.PRNGKey(0), np.array([[q]]), kT=0.0, mass=m, momenta=np.array([[m * v]]))

        def step() -> tuple[float, float]:
            nonlocal state
            state = move(state)
            return float(state.position[0, 0]), float(state.velocity[0, 0])

        return step

    return Springs(scene, step, spring)


def version() -> dict[str, str]:
    """Versions of jax-md and JAX."""
    from importlib.metadata import version as of

    return {"jax-md": of("jax-md"), "jax": of("jax")}


ENGINE = Engine(
    name="jaxmd", title="jax-md", distribution="jax-md", module="jax_md",
    methods=methods(nve=("velocity-verlet", "simulate.nve, jax_enable_x64")), start=start, version=version,
)  # fmt: skip
