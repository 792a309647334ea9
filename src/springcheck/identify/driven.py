"""A force, or a stiffness, that oscillates in time: frequency, amplitude and phase.

With a drive a scheme takes z to A z + Re(b exp(i w n)).  Minus the steady state (exp(i w) - A)**-1 b, the
motion is that of the scheme without a drive, and is identified as such; the scheme's response b to a drive of
amplitude 1 gives the amplitude.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import IdentificationError
from springcheck.identify.compare import compare
from springcheck.identify.evidence import AGREES, Evidence
from springcheck.identify.families import MOST_TITLES
from springcheck.identify.fit import fit
from springcheck.identify.hypothesis import FEW, SURE, Match, distinct
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.driven import CLOCK
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Drive, WallSpring
from springcheck.schemes import Law, scheme, title


def frequency(e: Evidence, carrier: Floats) -> float:
    """Angular frequency [rad/frame] of the sine and cosine, times a carrier (f - 1,), that explain most of
    the map's residuals beside the map's own columns."""
    frames, pull = e.pairs, e.weight * carrier
    linear = np.stack(e.linear, axis=1) * e.weight[:, None]
    across, missing = np.linalg.qr(linear)[0], e.residuals * e.weight[:, None]
    missing = missing - across @ (across.T @ missing)
    columns = np.concatenate([missing, across], axis=1).T * pull
    size = 1 << (8 * frames - 1).bit_length()
    at = np.arange(size // (4 * frames), size // 2 + 1)
    waves = np.fft.fft(columns, size).conj()[:, at]
    double = np.fft.fft(pull**2, size // 2).conj()[at % (size // 2)]
    # the normal equations of a cosine and a sine beside the map's own columns, at every frequency
    c, s, total = waves.real, waves.imag, float(np.sum(pull**2))
    cc = (total + double.real) / 2 - np.sum(c[2:] ** 2, axis=0)
    ss = (total - double.real) / 2 - np.sum(s[2:] ** 2, axis=0)
    cs = double.imag / 2 - np.sum(c[2:] * s[2:], axis=0)
    det = np.maximum(cc * ss - cs * cs, 1e-9 * total * total + 1e-300)
    x, y = c[:2], s[:2]
    gain = np.sum((x * x * ss - 2 * x * y * cs + y * y * cc) / det, axis=0)
    turn = 2 * np.pi / size * float(at[np.argmax(gain)])
    return _tuned(linear, missing, pull, turn)[0]


def waves(carrier: Floats, turn: float) -> list[Floats]:
    """A carrier times the cosine and sine of an angle that advances by `turn` a frame."""
    n = np.arange(len(carrier))
    return [carrier * np.cos(turn * n), carrier * np.sin(turn * n)]


TUNING_STEPS = 12
"""Most Gauss-Newton steps for a frequency: three or four converge."""

STARTS_BESIDE, FEW_FRAMES = 6, 2000
"""Starting values on either side, a quarter turn over the run apart, and most frames that have them."""


def _best(z: Floats, carrier: Floats, turn: float) -> tuple[float, Floats]:
    """Angle per frame [rad] and coefficients (5, 2) of z, 1, carrier cos and carrier sin that fit the states
    z best, from several starting values: near a resonance the drive beats with the motion."""
    apart = np.pi / (2 * len(z)) if len(z) <= FEW_FRAMES else 0.0
    columns = np.stack([*z[:-1].T, np.ones(len(z) - 1)], axis=1)
    found = []
    for away in sorted(range(-STARTS_BESIDE, STARTS_BESIDE + 1) if apart else (0,), key=abs):
        found.append(_tuned(columns, z[1:], carrier, abs(turn + away * apart)))
        if found[-1][2] <= AGREES**2:
            break
    return min(found, key=lambda one: one[2])[:2]


def _tuned(linear: Floats, ends: Floats, carrier: Floats, turn: float) -> tuple[float, Floats, float]:
    """Angle per frame at which the columns `linear` (f, n), carrier cos and carrier sin fit `ends` (f, 2)
    best, the coefficients (n + 2, 2), and the largest residual."""
    n = np.arange(len(ends))
    rows, worst = np.empty((linear.shape[1] + 2, 2)), np.inf
    for _ in range(TUNING_STEPS):
        c, s = waves(carrier, turn)
        columns = np.concatenate([linear, c[:, None], s[:, None]], axis=1)
        rows = np.linalg.lstsq(columns, ends)[0]
        slope = n[:, None] * (c[:, None] * rows[-1] - s[:, None] * rows[-2])
        # what of the slope the other columns do not take up
        slope -= columns @ np.linalg.lstsq(columns, slope)[0]
        left = ends - columns @ rows
        worst = float(np.max(np.abs(left)))
        move = float(np.sum(slope * left) / max(float(np.sum(slope * slope)), 1e-300))
        turn += move
        if abs(move) * len(n) < 1e-15:
            break
    return turn, np.asarray(rows), worst


def said(e: Evidence, forced: bool, turn: float) -> str:
    """Formula of a drive, or of an oscillating stiffness, with its amplitude, frequency and phase."""
    z = e.found.z.astype(np.float64)
    turn, rows = _best(z, np.ones(e.pairs) if forced else z[:-1, 0], turn)
    w = turn / float(e.record.interval)
    b = rows[3] - 1j * rows[4]
    if not forced:
        deep = b[1] / rows[0, 1]
        return f": about as 1 + {_wave(deep, w, '.2g', '.4g')}, the phase at the first frame"
    of = "" if e.record.mass is not None else " for each unit of mass"
    drives = [(turn, rows)]
    own = np.linalg.eigvals(rows[:2])
    if np.all(np.abs(np.abs(own) - 1) <= AGREES):
        # without friction the spring may as well turn as the drive does, and the drive as the spring
        drives.append(_best(z, np.ones(e.pairs), float(abs(np.angle(own[0])))))
        if e.stated:
            stated = math.sqrt(abs(e.stated))
            drives = [max(drives, key=lambda one: abs(abs(one[0]) - stated))]
    more = "" if len(drives) < 2 else " (without friction the states do not tell which; give the stiffness)"
    ways = [f"the force {x}" for x in (_forces(e, x, y, of) for y, x in drives) if x]
    if ways:
        more = more if len(ways) > 1 else ""
        return f". It is a spring with {', or with '.join(ways)}{more}, the phase at the first frame"
    unit = float(e.found.size[1]) / float(e.record.interval) ** 2
    unit *= 1.0 if e.record.mass is None else float(e.record.mass[e.j])
    about = [
        f"about {_wave((x[3, 1] - 1j * x[4, 1]) * unit, y / float(e.record.interval), '.2g', '.6g')}{of}"
        for y, x in drives
    ]
    return f": {', or '.join(about)}{more}, the phase at the first frame"


def _forces(e: Evidence, rows: Floats, turn: float, of: str) -> str:
    """The drive of this angle per frame by each scheme of the motion without its steady state that has its
    response; "" where none has."""
    record, j, found = e.record, e.j, e.found
    b = rows[3] - 1j * rows[4]
    turned = np.exp(1j * turn * np.arange(len(found.z)))[:, None]
    try:
        steady = np.linalg.solve(np.exp(1j * turn) * np.eye(2) - rows[:2].T, b)
        centre = np.linalg.solve(np.eye(2) - rows[:2].T, rows[2])
        left = found.z - (turned * steady).real - centre
        q, v = record.q.copy(), record.v.copy()
        q[:, j], v[:, j] = left[:, 0] * found.size[0], left[:, 1] * found.size[1] / record.interval
        alone = fit(replace(record, q=q, v=v), j)
    except (np.linalg.LinAlgError, IdentificationError):
        # it is in resonance, or in its steady state all along
        return ""
    # what is left has the roundings of the whole motion, and of what was subtracted
    size = float(np.max(np.abs(found.z)) / np.max(np.abs(left)))
    terms = [replace(e.terms, rounding=e.terms.rounding * (1 + size))]
    several = (compare([alone], terms, distinct(damped=damped), FEW[:4]) for damped in (False, True))
    drives: dict[str, str] = {}
    for joint in sorted(itertools.chain(*several), key=lambda x: x.simplicity):
        match = joint.parts[0]
        unit = _response(e, match, turn)
        # other schemes have its map with other springs than the stated one
        off = 0.0 if e.stated is None else abs(match.a * match.stride**2 - e.stated)
        if unit is None or match.turns != 0 or not off <= AGREES * abs(e.stated or 0.0):
            continue
        strength = complex(np.vdot(unit, b) / np.vdot(unit, unit))
        if np.max(np.abs(b - strength * unit)) <= AGREES * np.max(np.abs(b)):
            drives.setdefault(match.scheme, _wave(strength, turn / float(record.interval), ".9g", ".9g"))
    ways = [f"{wave}{of} by {title(name)}" for name, wave in list(drives.items())[:MOST_TITLES]]
    return ", or ".join(ways)


def _wave(strength: complex, w: float, first: str, digits: str) -> str:
    if w < 0:
        strength, w = strength.conjugate(), -w
    phase = math.atan2(strength.imag, strength.real)
    sign = "-" if phase < 0 else "+"
    return f"{abs(strength):{first}} cos({w:{digits}} t {sign} {abs(phase):{first}})"


def _response(e: Evidence, match: Match, turn: float) -> NDArray[np.complex128] | None:
    """Response b to a force cos(w t), in the units of the map: a frame from rest, by the scheme with a clock.
    None for a scheme that is not one-step, or that has a friction stage without friction."""
    law = scheme(match.scheme)
    if not law.has("one-step") or (law.has("friction") and match.friction <= SURE * match.g_error):
        # without friction such a scheme is one without a stage for it
        return None
    h = float(e.record.interval) / match.stride
    m = 1.0 if e.record.mass is None else float(e.record.mass[e.j])
    one, number = np.array([0]), np.ones(1)
    terms: list[Any] = [WallSpring(i=one, k=match.a * m / h**2 * number, at=0 * number)]
    if match.friction > 0:
        terms.append(Damping(i=one, c=match.friction * m / h * number))
    parts = []
    for phase in (0.0, np.pi / 2):
        drive = Drive(
            i=one, amplitude=number, frequency=turn / h / match.stride * number, phase=phase * number
        )
        scene = Scene(m=m * number, q=0 * number, p=0 * number, terms=(*terms, drive), step=h, steps=1)
        whole = Law(scheme=law, scene=scene.system.clocked, h=h)
        q: Reals = np.zeros(2, np.longdouble)
        p: Reals = np.array([0, CLOCK], np.longdouble)
        for _ in range(match.stride):
            q, p = whole.step(q, p)
        parts.append([float(q[0]), float(p[0]) / m * float(e.record.interval)])
    # Re(b exp(i phase)) at two phases
    return (np.array(parts[0]) - 1j * np.array(parts[1])) / e.found.size.astype(np.float64)
