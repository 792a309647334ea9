"""diffrax, with x64 switched on: its solvers at a constant step."""

from typing import Any

from springs import Springs, methods

from springcheck.engines import Engine

SOLVERS = {
    "euler": ("Euler", "explicit-euler"),
    "heun": ("Heun", "rk2-heun"),
    "midpoint": ("Midpoint", "rk2-midpoint"),
    "ralston": ("Ralston", "rk2-heun"),
    "implicit_euler": ("ImplicitEuler", "implicit-euler"),
    "semi_implicit_euler": ("SemiImplicitEuler", "semi-implicit-euler-drift-kick"),
}


def start(scene: Any, method: Any, label: Any, step: float) -> Springs:
    """A run."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    name = SOLVERS[method.name.replace("-", "_")][0]

    def spring(m: float, k: float, at: float, q: float, v: float, h: float) -> Any:
        if name == "SemiImplicitEuler":
            solver = diffrax.SemiImplicitEuler()
            terms: Any = (
                diffrax.ODETerm(lambda t, v, _: v),
                diffrax.ODETerm(lambda t, q, _: -k * (q - at) / m),
            )
            y: Any = (jnp.array(q), jnp.array(v))
        else:
            tight = (
                {"root_finder": diffrax.VeryChord(rtol=1e-14, atol=1e-15)} if name == "ImplicitEuler" else {}
            )
            solver = getattr(diffrax, name)(**tight)
            terms = diffrax.ODETerm(lambda t, y, _: jnp.array([y[1], -k * (y[0] - at) / m]))
            y = jnp.array([q, v])
        state = solver.init(terms, 0.0, h, y, None)

        @jax.jit
        def move(y: Any, state: Any) -> Any:
            new, *_, kept, _ = solver.step(terms, 0.0, h, y, None, state, made_jump=False)
            return new, kept

        def step() -> tuple[float, float]:
            nonlocal y, state
            y, state = move(y, state)
            return float(y[0]), float(y[1])

        return step

    return Springs(scene, step, spring)


def version() -> dict[str, str]:
    """Versions of diffrax and JAX."""
    from importlib.metadata import version as of

    return {"diffrax": of("diffrax"), "jax": of("jax")}


ENGINE = Engine(
    name="diffrax", title="diffrax", distribution="diffrax",
    methods=methods(**{x: (scheme, f"{name} at a constant step") for x, (name, scheme) in SOLVERS.items()}),
    start=start, version=version,
)  # fmt: skip
