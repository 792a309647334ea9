"""One step of OpenMM's DPDIntegrator, of two particles and of three, beside its law.

Claim: a kick, half a drift, then pair by pair, with w = 1 - r/cutoff > 0 at their distance r of that moment,
u' = c u + sqrt((1 - c**2) kT/mu) xi for the relative velocity u along the pair, c = exp(-2 gamma w**2 h) of
any masses; then half a drift.  What lies across is kept, and so is the momentum; the velocity that is stored
is half a step early, as BAOA's.  Its friction follows the distance, so that no matrices A and G belong to it.

Command: python validation/dpd.py     (6 seconds; exit status 1 where OpenMM departs from its law)

Printed with OpenMM 8.6.1, Reference:

    r 0.3, masses (3.7, 1.9): c 0.909855497860, law 0.909855497860           off by 1e-17 of 4e-15
    r 0.9, masses (3.7, 1.9): c 0.960978923225, law 0.960978923225           off by 2e-18 of 4e-15
    r 0.9, masses (1.0, 250.0): c 0.960973725663, law 0.960973725663         off by 3e-17 of 4e-15
    r 1.5, masses (3.7, 1.9): c 0.991634994927, law 0.991634994927           off by 3e-17 of 4e-15
    r 2.2, masses (3.7, 1.9): c 1.000000000000, law 1.000000000000           off by 3e-18 of 4e-15
    three particles, one order of six (the next 1e-06)                       off by 3e-17 of 4e-15
    300 K, but for one number along the pair                                 off by 2e-16 of 4e-15
    its variance over the law's, 20000 seeds                                 off by 6e-03 of 5e-02
"""

from itertools import combinations, permutations
from typing import Any

import numpy as np
import openmm as mm

from arguments import arguments, script

H, GAMMA, CUTOFF, K, REST, PAIR = 0.05, 1.3, 2.0, 2.9, 0.8, [(0, 1)]
KT = 300 * 1.380649e-23 * 6.02214076e23 / 1000
BOUND, DRAWS = 40 * 2.0**-53, 20_000  # roundings of a step of a few operations each, over numbers of size 1


def step(m: Any, x: Any, v: Any, temperature: float = 0.0, seed: int = 1) -> tuple[Any, Any]:
    """Positions and velocities (n, 3) after one step of OpenMM, springs between neighbours."""
    system, springs = mm.System(), mm.HarmonicBondForce()
    for i, one in enumerate(m):
        system.addParticle(one)
        _ = springs.addBond(i - 1, i, REST, K) if i else 0
    system.addForce(springs)
    integrator = mm.DPDIntegrator(temperature, GAMMA, CUTOFF, H)
    integrator.setRandomNumberSeed(seed)
    context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
    context.setPositions(x)
    context.setVelocities(v)
    integrator.step(1)
    state = context.getState(positions=True, velocities=True)
    return state.getPositions(asNumpy=True)._value, state.getVelocities(asNumpy=True)._value


def law(m: Any, x: Any, v: Any, pairs: Any, given: Any = None) -> tuple[Any, Any, Any, float]:
    """The same by formula, or with a `given` relative velocity; the last pair's direction and c."""
    v, e, c = v.copy(), np.zeros(3), 1.0
    for i in range(len(m) - 1):
        pull = K * (1 - REST / np.linalg.norm(x[i + 1] - x[i])) * (x[i + 1] - x[i])
        v[i], v[i + 1] = v[i] + H * pull / m[i], v[i + 1] - H * pull / m[i + 1]
    x = x + H / 2 * v
    for i, j in pairs:
        r, mu = float(np.linalg.norm(x[j] - x[i])), m[i] * m[j] / (m[i] + m[j])
        e, c = (x[j] - x[i]) / r, float(np.exp(-2 * GAMMA * max(1 - r / CUTOFF, 0) ** 2 * H))
        change = (c * (v[j] - v[i]) @ e if given is None else given) - (v[j] - v[i]) @ e
        v[i], v[j] = v[i] - mu / m[i] * change * e, v[j] + mu / m[j] * change * e
    return x + H / 2 * v, v, e, c


def main(draws: int | None = None) -> int:
    """One line a claim; 1 where one does not hold."""
    draws = draws or arguments(__doc__, draws=DRAWS).draws
    rng, rows, m, three, xi = (
        np.random.default_rng(20261123),
        [],
        (3.7, 1.9),
        (3.7, 1.9, 2.3),
        np.empty(draws),
    )
    turn, v = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=(3, 3)) * 0.1
    for r, pair in ((0.3, m), (0.9, m), (0.9, (1.0, 250.0)), (1.5, m), (2.2, m)):
        x = np.array([[0, 0, 0], [r, 0, 0]]) @ turn
        found, of, before = step(pair, x, v[:2]), law(pair, x, v[:2], PAIR), law(pair, x, v[:2], ())[1]
        c = float(np.diff(found[1], axis=0)[0] @ of[2] / (np.diff(before, axis=0)[0] @ of[2]))
        rows.append(
            (f"r {r}, masses {pair}: c {c:.12f}, law {of[3]:.12f}", np.subtract(found, of[:2]), BOUND)
        )
    orders = [law(three, turn, v, order)[:2] for order in permutations(combinations(range(3), 2))]
    off = sorted(float(np.abs(np.subtract(step(three, turn, v), one)).max()) for one in orders)
    rows.append((f"three particles, one order of six (the next {off[1]:.0e})", off[0], BOUND))
    for i in range(draws):
        found, (_, _, e, c) = step(m, turn[:2], v[:2], 300.0, i + 1), law(m, turn[:2], v[:2], PAIR)
        u = np.diff(found[1], axis=0)[0] @ e
        xi[i] = u - c * np.diff(law(m, turn[:2], v[:2], ())[1], axis=0)[0] @ e
        worst = np.abs(np.subtract(found, law(m, turn[:2], v[:2], PAIR, u)[:2])).max()
        rows[6:] = [("300 K, but for one number along the pair", max(worst, rows[6][1] if i else 0), BOUND)]
    variance = np.mean(xi**2) / ((1 - c * c) * KT * sum(m) / np.prod(m))
    rows.append((f"its variance over the law's, {draws} seeds", variance - 1, 5 * (2 / draws) ** 0.5))
    for claim, value, bound in rows:
        print(f"    {claim:72} off by {np.abs(value).max():.0e} of {bound:.0e}")
    return 0 if all(np.abs(value).max() <= bound for _, value, bound in rows) else 1


if __name__ == "__main__":
    script(main)
