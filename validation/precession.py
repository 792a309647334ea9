"""Precession of a Kepler orbit in Verlet's scheme, against the law of its modified Hamiltonian.

Claim: velocity and position Verlet conserve the angular momentum to rounding.  In every orbit they turn the
axis of the ellipse backwards by (pi/8) (4 + e**2)/(1 - e**2)**3 (h Omega)**2, Omega = 2 pi/period.

Reason: up to h**4 velocity Verlet conserves T + V + h**2 (v V'' v/12 - F**2/(24 m)) (Hairer, Lubich & Wanner,
Geometric Numerical Integration (2006), IX.3), and position Verlet T + V + h**2 (F**2/(12 m) - v V'' v/24).
Over an ellipse of semi-axis a both v V'' v and F**2/m average K**2/(m a**4) (3 x**(-5/2) - x**(-3/2))/2, with
x = 1 - e**2 = L**2/(m K a), so both schemes turn alike: the average's derivative by L times the period.  What
is left falls like h**2 relative to the law.

Command: python validation/precession.py        (seconds)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck import load_scene
from springcheck.engines.own.simulation import prepare
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Kepler

ORBITS = 8
ALLOWED = 8.0
"""Largest relative difference from the law, in units of (h Omega)**2/(1 - e**2)**3."""


def orbit(m: float, strength: float, a: float, e: float, steps: int) -> Scene:
    """An ellipse from its pericentre, in so many steps for each of its periods."""
    momentum = math.sqrt(m * strength * (1 + e) / (a * (1 - e)))
    laws: Any = Kepler
    law = laws.to_points(i=[0, 1], at=[0, 0], strength=[strength] * 2, number=[0, 0])
    step = 2 * math.pi * math.sqrt(m * a**3 / strength) / steps
    start = {"m": [m] * 2, "q": [a * (1 - e), 0], "p": [0, momentum]}
    return load_scene("kepler").replace(**start, terms=(law,), step=step, steps=ORBITS * steps)


def turned(scene: Scene, strength: float, scheme: str) -> tuple[float, float]:
    """Turn of the axis in one orbit, and the largest relative change of the angular momentum."""
    q, p = np.empty((2, scene.steps, 2))
    prepare(scene, scheme, scene.step).advance(1, q, p)
    spin = q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0]
    # the Laplace-Runge-Lenz vector p x L/(m K) - q/|q| points to the pericentre
    x, y = np.stack([p[:, 1], -p[:, 0]]) * spin / (scene.m[0] * strength) - (q / np.hypot(*q.T)[:, None]).T
    of_orbits = np.unwrap(np.arctan2(y, x)).reshape(ORBITS, -1).mean(axis=1)
    begun = scene.q[0] * scene.p[1]
    return float(np.polyfit(np.arange(ORBITS), of_orbits, 1)[0]), float(np.max(np.abs(spin / begun - 1)))


def law(e: float, h: float) -> float:
    """The same by theory, for a step h in units of 1/Omega."""
    return -math.pi / 8 * (4 + e * e) / (1 - e * e) ** 3 * h * h


def main() -> int:
    """Measure several orbits and steps; the exit status is 1 where one is off the law."""
    arguments(__doc__)
    wrong = 0
    print(
        "scheme            m    K    a    e   h Omega  turn/orbit    law           off     angular momentum"
    )
    for m, strength, a, e in ((0.7, 1.5, 2.0, 0.5), (3.1, 0.4, 0.9, 0.2), (1.3, 2.2, 1.6, 0.7)):
        for scheme, steps in (("velocity-verlet", 500), ("velocity-verlet", 2000), ("position-verlet", 2000)):
            found, change = turned(orbit(m, strength, a, e, steps), strength, scheme)
            h = 2 * math.pi / steps
            off, most = found / law(e, h) - 1, ALLOWED * h * h / (1 - e * e) ** 3
            wrong += not (abs(off) <= most and change < 1e-12)
            print(f"{scheme:16} {m:4} {strength:4} {a:4} {e:4} {h:9.5f} {found:12.4e} {law(e, h):12.4e} "
                  f"{off:9.1e} {change:9.1e}")  # fmt: skip
    return int(wrong > 0)


if __name__ == "__main__":
    script(main)
