"""What the words of an identification mean: formula, what it shows, what it does not, and its source."""

from __future__ import annotations

from dataclasses import dataclass

from springcheck.identify.catalogue import FAULTS

GEOMETRIC = "Hairer, Lubich & Wanner, Geometric Numerical Integration (2006)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Meaning:
    """One finding in words."""

    name: str
    title: str
    formula: str
    sees: str
    misses: str
    source: str = ""


_KNOWN = (
    Meaning(
        name="one-step-map",
        title="the matrix of one step, read off the states",
        formula="(q, v h)[n+1] = M (q, v h)[n], M by least squares over all pairs of states",
        sees="which scheme made the states: on a spring every scheme has its own M, a function of (h w)**2",
        misses="what has the same M on a spring: schemes that differ only in nonlinear forces",
        source=f"{GEOMETRIC}, I.1 and IX",
    ),
    Meaning(
        name="symplectic-defect",
        title="how far the map is from keeping area",
        formula="largest entry of |M^T J M - J|, J = [[0, 1], [-1, 0]]; for one particle |det M - 1|",
        sees="gain or loss of amplitude: explicit Euler, friction, a thermostat",
        misses="every error that keeps area: a wrong stiffness, mass or step, a wrong symplectic scheme",
        source=f"{GEOMETRIC}, VI.2",
    ),
    Meaning(
        name="velocity-offset",
        title="the time of the velocities after that of the positions, in steps",
        formula="-1/2 or +1/2 where the map is symmetric once velocities are moved by half a step, else 0",
        sees="leapfrog, whose velocities belong to times half a step from those of its positions",
        misses="whether an engine means leapfrog or semi-implicit Euler: both have the very same states",
        source="Hockney & Eastwood, Computer Simulation Using Particles (1988), 4.4",
    ),
    Meaning(
        name="defect-ulp",
        title="what one recorded step departs from the scheme's own, in units of 2**-52",
        formula="max |state[n+1] - Phi(state[n])| / (2**-52 size of the terms that were added up)",
        sees="the arithmetic: a few units for double, 1e8 for single precision or single-precision forces",
        misses="errors that lie below the rounding of the numbers in the file, as in text of six digits",
    ),
    Meaning(
        name="not-told-apart",
        title="several schemes explain every state to the rounding of the file",
        formula="chi-square of each scheme's map against the measured one, by the covariance of the fit",
        sees="all schemes that are left, each with its own step, frequency and stiffness",
        misses="which of them it was; more digits, a larger step or the stiffness tell, as the notes say",
    ),
    Meaning(
        name="adaptive",
        title="a solver that chooses its own steps",
        formula="no fixed M: the states are the exact solution to within a tolerance, not to rounding",
        sees="states nearer to the exact solution than any scheme of this step",
        misses="which solver it was; its error against its tolerance is judged by the check `tolerance`",
    ),
    Meaning(
        name="held-force",
        title="one force used for several substeps",
        formula="q' = q + h v + s (h**2 F/m), v' = v + h F/m with one F; s tells the number of substeps",
        sees="frame skip: a control loop that sets the force once for several steps of the engine",
        misses="a force used for a whole step of a scheme that calls it once anyway",
    ),
)

_FAULTS = tuple(
    Meaning(
        name=one.scheme,
        title=one.fault,
        formula="a one-step map of its own, found like a scheme's; see one-step-map",
        sees="exactly this mistake: every state is explained by it to rounding, and by no known scheme",
        misses=f"other mistakes of the same map.  What to do: {one.remedy}",
    )
    for one in FAULTS
    if not one.over
)

MEANINGS = {one.name: one for one in (*_KNOWN, *_FAULTS)}
"""Every finding by its name."""
