"""OpenMM's VariableVerletIntegrator replayed by its own rule, and the law of the energy that it gains.

Claim: every step is velocity Verlet of the step that its rule says, to rounding; the energy changes by
that of the step alone; and the gain of a period is a law of the ratio of tolerance and amplitude.

Command: python validation/variable_verlet.py    (half a minute)

The rule (ReferenceVariableVerletDynamics::update): h' = sqrt(tolerance/e), e the root of the mean of
(F/m)**2 over x, y and z of all particles; at most 2 h; h itself where h' lies between h and 1.2 h.  The
stored velocity belongs half a step back, and is kicked by (h + h')/2.  Read on by half a kick of its own
step the states are those of velocity Verlet, whose steps keep v**2/2 + w2 x**2/2 (1 - (h w)**2/4), each
with its own h.  So

    E' - E = m (h**2 w2**2/8) (x'**2 - x**2)

exactly, at every step, and nothing else changes the energy.  On a spring of amplitude A let c =
tolerance/A and xi = x/A: (h w)**2 = sqrt(3) c/|xi|, so the gain is a function of c alone.

* Outwards the step follows its rule, and the sum of h**2 d(x**2) is that of 2 sqrt(3) c |xi| d|xi|/|xi|.
  Inwards it is held while it would grow by less than 1.2, |xi| by 1/1.44, and the sum is (1 + 1/1.44)/2
  of that.  Over a period the difference is a gain of (sqrt(3)/2) (1 - 1/1.44) c = 0.2646 c of the energy.
* Without holding it would be 0 to first order.  Half the sum of -d(h**2) d(x**2), for a step is chosen at
  its start, is c**(3/2) times an integral of |xi|**(-3/2), which ends where a step passes 0, |xi| =
  c**(1/3): it falls as c**(4/3), 9 c**(4/3) as measured.

Expected: 5,000 steps of three systems: the largest departure of a step is 1.8 roundings, of the energy's
law 4e-15 of the energy; and this table (OpenMM 8.6.1, Reference), the gain of a period over c beside
0.2646 + 9 c**(1/3).

    tolerance/A    measured    the law's sum, of the recorded steps    0.2646 + 9 c**(1/3)
      1e-02          1.4567                  1.4567                        2.2036
      3e-03          1.2222                  1.2222                        1.5626
      1e-03          1.2188                  1.2188                        1.1646
      3e-04          0.8594                  0.8594                        0.8671
      1e-04          0.6052                  0.6052                        0.6824
      1e-05          0.4416                  0.4416                        0.4585
      1e-06          0.3202                  0.3202                        0.3546
"""

from __future__ import annotations

from typing import Any

import numpy as np

from arguments import arguments, script


def recorded(m: Any, k: Any, x: Any, v: Any, tolerance: float, steps: int) -> tuple[Any, ...]:
    """Recorded times (f,), positions and velocities (f, n, 3), the latter half a step early."""
    import openmm as mm

    system, spring = mm.System(), mm.CustomExternalForce("(kx*x^2+ky*y^2+kz*z^2)/2")
    for name in ("kx", "ky", "kz"):
        spring.addPerParticleParameter(name)
    for i, mass in enumerate(m):
        system.addParticle(mass)
        spring.addParticle(i, k[i])
    system.addForce(spring)
    integrator = mm.VariableVerletIntegrator(tolerance)
    context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
    context.setPositions(x)
    context.setVelocities(v)
    times, places, speeds = [0.0], [np.array(x)], [np.array(v)]
    for _ in range(steps):
        integrator.step(1)
        state = context.getState(positions=True, velocities=True)
        times.append(state.getTime()._value)
        places.append(np.array(state.getPositions()._value))
        speeds.append(np.array(state.getVelocities()._value))
    return np.array(times), np.array(places), np.array(speeds)


def rule(push: Any, h: float, tolerance: float) -> float:
    """The next step, from the accelerations (n, 3) and the step before, 0 at the start."""
    new = float(np.sqrt(tolerance / np.sqrt(np.mean(push**2))))
    new = min(new, 2 * h) if h > 0 else new
    return h if h < new < float(np.float32(1.2)) * h else new


def judged(m: Any, k: Any, x: Any, v: Any, tolerance: float, steps: int) -> tuple[float, float]:
    """The largest departure of a step from the rule's own, in roundings, and of the energy from its law."""
    m, k = np.array(m), np.array(k)
    t, q, u = recorded(m, k, x, v, tolerance, steps)
    w2 = (k / m[:, None]).astype(np.longdouble)
    q, u = q.astype(np.longdouble), u.astype(np.longdouble)
    h, worst, energy_off = np.longdouble(0), 0.0, 0.0
    for i in range(steps):
        push = -w2 * q[i]
        new = np.longdouble(rule(push.astype(np.float64), float(h), tolerance))
        kicked = u[i] + push * (h + new) / 2
        moved = q[i] + new * kicked
        # a velocity is a difference of positions over the step
        units = (np.abs(q[i]) + np.abs(moved) + np.abs(new * kicked)) * 2.0**-53 + 5e-324
        off_q = np.max(np.abs(moved - q[i + 1]) / units)
        off_u = np.max(np.abs(kicked - u[i + 1]) / (units / new + 2.0**-53 * (np.abs(u[i]) + np.abs(kicked))))
        clock = abs(float(t[i + 1] - t[i]) - float(new)) / (2.0**-53 * (t[i + 1] + float(new)))
        worst = max(worst, float(off_q), float(off_u), clock)
        # at the ends of the step: half a kick of its own step
        start, end = kicked - push * new / 2, u[i + 1] - w2 * q[i + 1] * new / 2
        mass = m[:, None]
        gained = np.sum(mass * (end**2 - start**2 + w2 * (q[i + 1] ** 2 - q[i] ** 2)) / 2)
        law = np.sum(mass * new**2 * w2**2 * (q[i + 1] ** 2 - q[i] ** 2) / 8)
        energy = np.sum(mass * (start**2 + w2 * q[i] ** 2) / 2)
        energy_off = max(energy_off, abs(float((gained - law) / energy)))
        h = new
    return worst, energy_off


def gain(ratio: float) -> tuple[float, float]:
    """The relative gain of energy of a period at tolerance/A, as measured at the ends of steps, and as
    the law's sum over the rule's own."""
    m, k, amplitude = 3.7, 2.9, 0.37
    w2 = k / m
    tolerance = ratio * amplitude
    steps = 400 + int(40 / ratio**0.5)
    t, q, u = recorded([m], [(k, 0.0, 0.0)], [(amplitude, 0, 0)], [(0, 0, 0)], tolerance, steps)
    x, v = q[:, 0, 0], u[:, 0, 0]
    h = np.diff(t)
    on_site = v[1:] - w2 * x[1:] * h / 2
    energies = on_site**2 / 2 + w2 * x[1:] ** 2 / 2
    law = np.cumsum(h**2 * w2**2 / 8 * np.diff(x**2))
    # between maxima of |x|, where v changes its sign
    turns = np.flatnonzero(np.sign(on_site[1:]) != np.sign(on_site[:-1]))[::2]
    first, last = turns[0], turns[-1]
    count = len(turns) - 1
    measured = (energies[last] / energies[first]) ** (1 / count) - 1
    said = (1 + (law[last] - law[first]) / energies[first]) ** (1 / count) - 1
    return float(measured), float(said)


SPRINGS = {
    "one spring along x": ([3.7], [(2.9, 0.0, 0.0)], [(0.37, 0, 0)], [(0.19, 0, 0)], 1e-3),
    "one in space": ([1.9], [(2.9, 1.3, 0.7)], [(0.3, -0.2, 0.1)], [(0.1, 0.2, -0.3)], 1e-4),
    "two of unlike mass": ([3.7, 0.9], [(2.9, 0.6, 0.0), (7.3, 0.0, 2.2)], [(0.3, 0.1, 0), (-0.05, 0, 0.4)],
                           [(0, 0.2, 0), (0.3, 0, 0)], 1e-2),
}  # fmt: skip


def main() -> int:
    """Print what the docstring repeats."""
    arguments(__doc__)
    wrong = 0
    for name, (m, k, x, v, tolerance) in SPRINGS.items():
        worst, energy = judged(m, k, x, v, tolerance, 5000)
        wrong += not (worst <= 8 and energy <= 1e-12)
        print(f"{name}: largest departure of a step {worst:.2f} roundings, of the energy's law {energy:.1e}")
    for ratio in (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6):
        measured, law = gain(ratio)
        wrong += not abs(measured - law) <= 1e-9
        form = np.sqrt(3) / 2 * (1 - 1 / 1.44) + 9 * ratio ** (1 / 3)
        print(f"{ratio:11.0e} {measured / ratio:15.4f} {law / ratio:15.4f} {form:15.4f}")
    return int(wrong > 0)


if __name__ == "__main__":
    script(main)
