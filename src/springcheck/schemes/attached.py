"""Schemes that follow from how a spring is attached to an engine, beside those that people choose.

A force that is set once and held over substeps, friction that is taken implicitly where the force is not, and
a spring that is solved for in every substep; and Boris' rotation, which is position Verlet without a field.
"""

from __future__ import annotations

from fractions import Fraction

from springcheck.schemes.catalogue import HALF, ONE, Scheme, Stage, splitting


def _force_held(n: int) -> tuple[Stage, ...]:
    """Kick and drift, n times a step, by the one force of its beginning."""
    part = Fraction(1, n)
    again: tuple[Stage, ...] = (("held", part), ("drift", part))
    return (("kick", part), ("drift", part), *(again * (n - 1)))


_ALL = (
    *(
        splitting(
            f"force-held-{n}", f"semi-implicit Euler, {n} substeps by one force", 1, 0.0, _force_held(n),
            "a control force held for a frame of n substeps (frame_skip): [[1 - g a, h/m], [-h k, 1]] "
            "with g = (n + 1)/2n and a = (h w)**2, determinant 1 + a (n - 1)/2n", symplectic=False,
        )
        for n in (2, 4, 5, 10)
    ),
    splitting(
        "force-held-rk4", "constant force over the step (RK4 of a force that is held)", 1, 0.0,
        (("kick", HALF), ("drift", ONE), ("held", HALF)),
        "a force held over infinitely many substeps; velocity Verlet that kicks twice by the old "
        "force; determinant 1 + (h w)**2/2", symplectic=False,
    ),
    splitting(
        "semi-implicit-euler-implicit-friction",
        "semi-implicit Euler, friction implicit: v' = (v + h F/m) / (1 + h c/m)", 1, 2.0,
        (("pull", ONE), ("implicit-friction", ONE), ("drift", ONE)),
        "MuJoCo documentation, Computation, Numerical integration: (M + h D) v' = M v + h F",
        symplectic=False,
    ),
    splitting(
        "boris", "Boris: half drift, half kick, turn, half kick, half drift", 2, 2.0,
        (("drift", HALF), ("pull", HALF), ("gyrate", ONE), ("pull", HALF), ("drift", HALF)),
        "Boris, Proc. Fourth Conf. Numerical Simulation of Plasmas (1970) 3; Qin et al., Phys. Plasmas 20 "
        "(2013) 084503: it keeps volume and is not symplectic", symplectic=False,
    ),
    Scheme(
        name="implicit-euler-4", title="implicit Euler, four substeps", order=1, limit=float("inf"),
        symplectic=False, b=(Fraction(1, 4),) * 4,
        a=tuple((Fraction(1, 4),) * (i + 1) + (Fraction(0),) * (3 - i) for i in range(4)),
        source="a spring that a solver of soft constraints takes implicitly in each of four substeps",
    ),
)  # fmt: skip

ATTACHED: dict[str, Scheme] = {scheme.name: scheme for scheme in _ALL}
