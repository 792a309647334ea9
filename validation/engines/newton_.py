"""Newton on the processor: a particle on a spring to a kinematic one, its length far from 0."""

from typing import Any

from springs import Springs, methods

from springcheck.engines import Engine
from springcheck.physics.arrays import Arithmetic

FAR = 8.0


def start(scene: Any, method: Any, label: Any, step: float) -> Springs:
    """A run."""
    import warp

    warp.config.log_level = warp.LOG_ERROR
    import newton

    solvers = {
        "semi-implicit": newton.solvers.SolverSemiImplicit,
        "xpbd": newton.solvers.SolverXPBD,
        "vbd": newton.solvers.SolverVBD,
    }

    def spring(m: float, k: float, at: float, q: float, v: float, h: float) -> Any:
        builder = newton.ModelBuilder(gravity=(0, 0, 0))
        wall = builder.add_particle(pos=(at - FAR, 0, 0), vel=(0, 0, 0), mass=0.0)
        ball = builder.add_particle(pos=(at, 0, 0), vel=(v, 0, 0), mass=m)
        builder.add_spring(wall, ball, ke=k, kd=0.0, control=0.0)
        builder.particle_q[ball] = (q, 0, 0)
        if method.name == "vbd":
            builder.color()
        model = builder.finalize(device="cpu")
        solver = solvers[method.name](model, **({"iterations": 20} if method.name != "semi-implicit" else {}))
        states, control = [model.state(), model.state()], model.control()

        def step() -> tuple[float, float]:
            states[0].clear_forces()
            solver.step(states[0], states[1], control, None, h)
            states.reverse()
            return float(states[0].particle_q.numpy()[ball, 0]), float(states[0].particle_qd.numpy()[ball, 0])

        return step

    return Springs(scene, step, spring)


def version() -> dict[str, str]:
    """Versions of Newton and Warp."""
    from importlib.metadata import version as of

    return {"newton": of("newton"), "warp": of("warp-lang")}


ENGINE = Engine(
    name="newton", title="Newton", distribution="newton", start=start, version=version,
    methods=methods(**{
        "semi-implicit": ("semi-implicit-euler", "SolverSemiImplicit, add_spring with its length far from 0"),
        "xpbd": ("implicit-euler", "SolverXPBD, 20 iterations, add_spring"),
        "vbd": ("implicit-euler", "SolverVBD, 20 iterations, add_spring"),
    }),
    arithmetic=lambda label: Arithmetic(name="single", state=2.0**-24, force=2.0**-20, parameters="single"),
)  # fmt: skip
