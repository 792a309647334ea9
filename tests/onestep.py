"""The one-step matrix of a scheme on a whole linear scene, also where it mixes the normal modes."""

import numpy as np

from springcheck import schemes
from springcheck.physics.arrays import Extended
from springcheck.physics.scene import Scene


def propagator(scheme: schemes.Scheme, scene: Scene, *, h: float) -> Extended:
    """One-step matrix (2n, 2n) on (q - q*, p - p*) of a linear scene, q* and p* a state that stays."""
    n = scene.n
    z = np.concatenate([np.zeros((1, 2 * n)), np.eye(2 * n)]).astype(np.longdouble)
    m, force, parts = scene.m.astype(np.longdouble), scene.system.force, scene.system.parts
    q, p = schemes.step(scheme, z[:, :n], z[:, n:], h=h, m=m, force=force, parts=parts)
    after = np.concatenate([q, p], axis=1)
    return np.asarray((after[1:] - after[0]).T, np.longdouble)
