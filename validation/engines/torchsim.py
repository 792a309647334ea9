"""torch-sim in double precision: its velocity Verlet, `nve`, on a model of springs."""

from typing import Any

from springs import Springs, methods

from springcheck.engines import Engine


def start(scene: Any, method: Any, label: Any, step: float) -> Springs:
    """A run."""
    import torch
    from torch_sim.integrators import nve
    from torch_sim.models.interface import ModelInterface
    from torch_sim.state import SimState

    torch.set_num_threads(1)
    width = {"dtype": torch.float64}

    class Model(ModelInterface):
        """One spring along x."""

        def __init__(self, k: float, at: float) -> None:
            super().__init__()
            self._device, self._dtype = torch.device("cpu"), torch.float64
            self._compute_stress, self._compute_forces = False, True
            self.k, self.at = k, at

        def forward(self, state: Any, **_: Any) -> dict[str, Any]:
            x = state.positions.clone()
            x[:, 0] -= self.at
            x[:, 1:] = 0
            return {"energy": (self.k / 2 * x**2).sum()[None], "forces": -self.k * x}

    def spring(m: float, k: float, at: float, q: float, v: float, h: float) -> Any:
        state = SimState(
            positions=torch.tensor([[q, 0.0, 0.0]], **width), masses=torch.tensor([m], **width),
            cell=100 * torch.eye(3, **width)[None], pbc=False, atomic_numbers=torch.tensor([1]),
        )  # fmt: skip
        dt, none = torch.tensor(h, **width), torch.tensor(0.0, **width)
        begin, move = nve(Model(k, at), dt=dt, kT=none, seed=0)
        now = begin(state)
        now.momenta = torch.tensor([[m * v, 0.0, 0.0]], **width)

        def step() -> tuple[float, float]:
            nonlocal now
            now = move(now, dt=dt)
            return float(now.positions[0, 0]), float(now.momenta[0, 0]) / m

        return step

    return Springs(scene, step, spring)


def version() -> dict[str, str]:
    """Versions of torch-sim and PyTorch."""
    from importlib.metadata import version as of

    return {"torch-sim": of("torch-sim-atomistic"), "torch": of("torch")}


ENGINE = Engine(
    name="torchsim", title="torch-sim", distribution="torch-sim-atomistic", module="torch_sim",
    methods=methods(nve=("velocity-verlet", "integrators.nve, float64")), start=start, version=version,
)  # fmt: skip
