"""torchdiffeq in double precision: its fixed-grid solvers, a step at a time."""

from typing import Any

from springs import Springs, methods

from springcheck.doors.function import UNKNOWN
from springcheck.engines import Engine

SOLVERS = {
    "euler": "explicit-euler", "midpoint": "rk2-midpoint", "heun2": "rk2-heun", "heun3": "unknown",
    "rk4": "rk4",
}  # fmt: skip


def start(scene: Any, method: Any, label: Any, step: float) -> Springs:
    """A run."""
    import torch
    from torchdiffeq import odeint

    torch.set_num_threads(1)

    def spring(m: float, k: float, at: float, q: float, v: float, h: float) -> Any:
        y = torch.tensor([q, v], dtype=torch.float64)
        grid = torch.tensor([0.0, h], dtype=torch.float64)

        def slope(_: Any, y: Any) -> Any:
            return torch.stack([y[1], -k * (y[0] - at) / m])

        def step() -> tuple[float, float]:
            nonlocal y
            y = odeint(slope, y, grid, method=method.name)[1]
            return float(y[0]), float(y[1])

        return step

    return Springs(scene, step, spring)


def version() -> dict[str, str]:
    """Versions of torchdiffeq and PyTorch."""
    from importlib.metadata import version as of

    return {"torchdiffeq": of("torchdiffeq"), "torch": of("torch")}


ENGINE = Engine(
    name="torchdiffeq", title="torchdiffeq", distribution="torchdiffeq",
    methods=methods(**{x: (scheme, f"odeint, method={x!r}, by steps") for x, scheme in SOLVERS.items()}),
    schemes=(UNKNOWN,), start=start, version=version,
)  # fmt: skip
