"""A rod in ASE's heat bath: what a step does to it, and the temperature that follows.

Claim: a step of ASE's Langevin with FixBondLengths is the map `eijnden`, to rounding, friction alone and with
its draws, none of which is projected by itself; and the rod's rotation has the temperature of a law.

Command: python validation/rod_bath_ase.py    (8 s)

ASE takes its noise of positions off again, (x' - x - noise)/h, to have the velocity of a drift; of the part
along the rod, which SHAKE has taken off already, that leaves its opposite, and the turn mixes it in.  So the
rotation is colder than its scheme on a free particle by a = h**2 kT/(reduced mass length**2) times what
`lost` says, 2/3 for small friction, to first order in a.  ASE counts 5 degrees of freedom a rod.

Expected (ASE 3.29.0): steps depart by 0.56 of their bound at most, which is mostly the tolerance; the turn
takes off 0.667(7), 0.617(4) and 0.524(3) a at friction h of 0.1, 0.5 and 1, by the law 0.660, 0.611, 0.521.

Exit status 0 while departures are within their bounds and means within 5 standard errors, 1 otherwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from arguments import arguments, script
from rod_bath import PULL, ROD, STEP, THERMAL, TOLERANCE, M, departure, mean, shown, started


def sizes(rate: Any, shot: Any) -> Any:
    """What is left of a velocity after half a step of ASE, and its c3, c4 and c5, for shot = 2 kT rate/m."""
    x, size = rate * STEP, np.sqrt(shot * STEP)
    c5 = STEP * size / (2 * np.sqrt(3))
    return 1 - x / 2 + x * x / 8, size * (0.5 - x / 8), rate / 2 * c5, c5


def eijnden(q: Any, p: Any, draws: Any, rate: Any, thermal: float, pull: Any) -> Any:
    """ASE's step: half a step of velocities, drift and SHAKE, the other half, projection."""
    b, c3, c4, c5 = sizes(rate, 2 * thermal * rate / M)
    moved, push = c5 * draws[1], (STEP / 2 - STEP**2 * rate / 8) * pull + M * (c3 * draws[0] - c4 * draws[1])
    end, _ = ROD.drifted(q, q + STEP * (b * p + push) / M + moved, p, STEP)
    return end, ROD.projected(end, b * M * (end - q - moved) / STEP + push)


class Scripted:
    """A generator for ASE, whose numbers are kept."""

    def __init__(self) -> None:
        self.rng, self.kept = np.random.default_rng(3), list[Any]()

    def standard_normal(self, size: Any) -> Any:
        self.kept.append(self.rng.standard_normal(size))
        return self.kept[-1]


def ase(q: Any, p: Any, steps: int, rate: float, thermal: float, pull: Any) -> Any:
    """States (f, n, 6), the draws behind them (2, f - 1, n, 6), and the degrees of freedom that it counts."""
    from ase import Atoms, units
    from ase.calculators.calculator import Calculator
    from ase.constraints import FixBondLengths
    from ase.md.langevin import Langevin

    class Pull(Calculator):  # type: ignore[misc]
        implemented_properties = ("energy", "forces")

        def calculate(self, *_: Any) -> None:
            self.results = {"energy": 0.0, "forces": np.tile(pull.reshape(2, 3), (len(q), 1))}

    atoms = Atoms(f"H{2 * len(q)}", positions=q.reshape(-1, 3), calculator=Pull())
    atoms.set_masses(np.tile(M[::3], len(q)))
    atoms.set_momenta(p.reshape(-1, 3))
    atoms.set_constraint(FixBondLengths([(2 * i, 2 * i + 1) for i in range(len(q))], tolerance=TOLERANCE))
    rng = Scripted()
    bath = Langevin(atoms, STEP, temperature_K=thermal / units.kB, friction=rate, rng=rng, fixcm=False)
    states = [(q, p)]
    for _ in range(steps):
        bath.step()
        states.append((atoms.positions.reshape(q.shape).copy(), atoms.get_momenta().reshape(q.shape)))
    draws = np.array(rng.kept).reshape(steps, 2, *q.shape).swapaxes(0, 1)
    return *map(np.array, zip(*states, strict=True)), draws, atoms.get_number_of_degrees_of_freedom()


def lost(friction: float, a: float, n: int, steps: int = 60) -> tuple[float, float, float]:
    """By how much turning moves ASE's rotational temperature, over a: in a loop in the frame of its rod, the
    error of that, and by the law of first order in a, of fourth moments of normal numbers by pairs."""
    b, c3, c4, c5 = sizes(friction / STEP, 2 * friction / STEP)
    c5, rng = c5 / STEP, np.random.default_rng(7)
    free = np.sqrt(a) * rng.normal(size=(n, 2))
    u, kept = np.stack([free, free]), []
    for _ in range(steps):
        one, two = np.sqrt(a) * rng.normal(size=(2, n, 3))
        moved, push = c5 * two, c3 * one - c4 * two
        # parts along the rod come with either sign: what is of first order in them goes
        moved, push = (np.stack([x, x * [1, 1, -1]]) for x in (moved, push))
        d = b * u + push[..., :2] + moved[..., :2]
        sine = np.linalg.norm(d, axis=-1)
        f, cosine = d / sine[..., None], np.sqrt(1 - sine**2)
        mixed = b * moved - push
        turned = (1 - cosine) * np.sum(mixed[..., :2] * f, -1) + sine * mixed[..., 2]
        u = b * (b * u + push[..., :2]) + push[..., :2] + f * turned[..., None]
        free = b * (b * free + push[0, :, :2]) + push[0, :, :2]
        kept.append(np.sum(u**2 - free**2, axis=(0, 2)) / (4 * a * a))
    vv, vx, xx = c3**2 + c4**2, -c4 * c5, c5**2
    still = (b * b * vv + vv + 2 * b * vv) / (1 - b**4)
    drift, rest = b * b * still + vv + 2 * vx + xx, b * b * xx + vv - 2 * b * vx
    both = (b**3 * still + (b + 1) * (vv + vx)) * (b * (vx + xx) - vv - vx)
    return *mean(kept[steps // 2 :]), (3 * both + drift * ((b + 1) * (b * vx - vv) + rest)) / (1 - b**4)


def judged(q: Any, p: Any, draws: Any, rate: float, thermal: float) -> float:
    """The departure of all steps."""
    q, p = q.astype(np.longdouble), p.astype(np.longdouble)
    return departure(eijnden(q[:-1], p[:-1], draws, np.longdouble(rate), thermal, PULL), (q[1:], p[1:]))


def rows(rods: int = 40000) -> Any:
    """What is measured, its value, its law, and what they may differ by."""
    for friction in (0.1, 0.5, 1.0):
        for thermal in (0.0, THERMAL):
            q, p, draws, freedoms = ase(*started(5), 40, friction / STEP, thermal, PULL)
            of = f"friction h {friction}: departure of a step, {'noise' if thermal else 'T = 0'}"
            yield of, judged(q, p, draws, friction / STEP, thermal), 0.0, 1.0
        yield "degrees of freedom of 5 rods", freedoms, 25, 0
        value, most, law = lost(friction, 0.002, rods)
        yield "what turning adds, over a", value, law, most


def main() -> int:
    """Print what is measured beside its law; 1 where one is off."""
    arguments(__doc__)
    return int(shown(rows()))


if __name__ == "__main__":
    script(main)
