"""Six steppers, each broken in one place.  Find out what is wrong from its states, and mend it.

    springcheck identify --stepper exercises:one          # what its states show
    python grade.py exercises.py                          # which are mended

Each is called as step(q, p, h, force, mass) and returns the state one step later; the name of the scheme that
it is meant to be stands beside it in `AIMS`.
"""

AIMS = {
    "one": "semi-implicit-euler",
    "two": "velocity-verlet",
    "three": "implicit-euler",
    "four": "semi-implicit-euler-drift-kick",
    "five": "velocity-verlet",
    "six": "rk4",
}


def one(q, p, h, force, mass):
    """Semi-implicit Euler: kick, then drift."""
    return q + h * p / mass, p + h * force(q)


def two(q, p, h, force, mass):
    """Velocity Verlet: half a kick, a drift, half a kick."""
    now = force(q)
    p = p + 0.5 * h * now
    q = q + h * p / mass
    return q, p + 0.5 * h * now


def three(q, p, h, force, mass):
    """Implicit Euler: position and momentum move by the state at the end of the step."""
    end_q = q + h * p / mass
    end_p = p + h * force(q)
    return q + h * end_p / mass, p + h * force(end_q)


def four(q, p, h, force, mass):
    """Semi-implicit Euler: drift, then kick."""
    q = q + h * p
    return q, p + h * force(q)


def five(q, p, h, force, mass):
    """Velocity Verlet by a formula: q + h v + h**2 a / 2."""
    a = force(q) / mass
    q = q + 0.5 * h * p / mass + h * h * a
    return q, p + 0.5 * h * (mass * a + force(q))


def six(q, p, h, force, mass):
    """The classical Runge-Kutta method."""

    def rate(q, p):
        return p / mass, force(q)

    a = rate(q, p)
    b = rate(q + h / 2 * a[0], p + h / 2 * a[1])
    c = rate(q + h / 2 * b[0], p + h / 2 * b[1])
    d = rate(q + h * c[0], p + h * c[1])
    weights = (1 / 6, 1 / 3, 1 / 3, 1 / 3)
    return tuple(
        x + h * sum(w * k[i] for w, k in zip(weights, (a, b, c, d), strict=True))
        for i, x in enumerate((q, p))
    )
