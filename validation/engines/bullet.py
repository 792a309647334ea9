"""Bullet through PyBullet: a body pulled by a force before each step, its default drag switched off."""

from typing import Any

from springs import Springs, methods

from springcheck.engines import Engine


def start(scene: Any, method: Any, label: Any, step: float) -> Springs:
    """A run, in a world of its own for each particle."""
    import pybullet

    def spring(m: float, k: float, at: float, q: float, v: float, h: float) -> Any:
        world = pybullet.connect(pybullet.DIRECT)
        pybullet.setTimeStep(h, physicsClientId=world)
        body = pybullet.createMultiBody(baseMass=m, basePosition=[q, 0, 0], physicsClientId=world)
        pybullet.changeDynamics(body, -1, linearDamping=0, angularDamping=0, physicsClientId=world)
        pybullet.changeDynamics(body, -1, maxJointVelocity=1e9, physicsClientId=world)
        pybullet.resetBaseVelocity(body, [v, 0, 0], physicsClientId=world)

        def step() -> tuple[float, float]:
            x = pybullet.getBasePositionAndOrientation(body, physicsClientId=world)[0]
            pull = [-k * (x[0] - at), 0, 0]
            pybullet.applyExternalForce(body, -1, pull, x, pybullet.WORLD_FRAME, physicsClientId=world)
            pybullet.stepSimulation(physicsClientId=world)
            x = pybullet.getBasePositionAndOrientation(body, physicsClientId=world)[0]
            return x[0], pybullet.getBaseVelocity(body, physicsClientId=world)[0][0]

        return step

    return Springs(scene, step, spring)


def version() -> dict[str, str]:
    """Version of the wheel."""
    from importlib.metadata import version as of

    return {"pybullet": of("pybullet")}


ENGINE = Engine(
    name="bullet", title="Bullet (PyBullet)", distribution="pybullet",
    methods=methods(force=("semi-implicit-euler", "applyExternalForce before each step, linearDamping 0")),
    start=start, version=version,
)  # fmt: skip
