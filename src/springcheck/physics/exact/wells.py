"""Closed forms of single particles in a well, and of pairs on a bond.

Each serves particles that nothing joins to others, all at once, at times t (f, 1).  Near a separatrix all
hangs on how far the energy lies from that of the barrier, and at the start on how far the particle stands
from its top.  Where these cancel they are taken in more digits (`digits`); nothing that follows loses any.
So every motion is known to a few roundings of its size and of its time, near a barrier as elsewhere.
"""

from __future__ import annotations

from springcheck.physics.exact.bond import MORSE
from springcheck.physics.exact.pendulum import COSINE
from springcheck.physics.exact.quartic import QUARTIC

WELLS = (QUARTIC, COSINE, MORSE)
"""The closed forms that there are.  A new one is a new entry."""
