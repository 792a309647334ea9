"""The steppers of exercises.py, mended; what was wrong stands beside each."""

from exercises import AIMS  # noqa: F401


def one(q, p, h, force, mass):
    """The drift took the old momentum: that is explicit Euler."""
    p = p + h * force(q)
    return q + h * p / mass, p


def two(q, p, h, force, mass):
    """The second half kick took the force of the first: one force held over the whole step."""
    p = p + 0.5 * h * force(q)
    q = q + h * p / mass
    return q, p + 0.5 * h * force(q)


def three(q, p, h, force, mass):
    """One iteration does not solve the equation of the step; it takes as many as rounding allows."""
    end_q, end_p = q, p
    for _ in range(500):
        new_q, new_p = q + h * end_p / mass, p + h * force(end_q)
        if (new_q, new_p) == (end_q, end_p):
            break
        end_q, end_p = new_q, new_p
    return end_q, end_p


def four(q, p, h, force, mass):
    """The mass was left out of the drift: dq/dt = p/m.  A mass of 1 hides it."""
    q = q + h * p / mass
    return q, p + h * force(q)


def five(q, p, h, force, mass):
    """The half stood at the wrong term: q + h v + h**2 a / 2."""
    a = force(q) / mass
    q = q + h * p / mass + 0.5 * h * h * a
    return q, p + 0.5 * h * (mass * a + force(q))


def six(q, p, h, force, mass):
    """The last weight was 1/3: the weights of a Runge-Kutta method add up to 1."""

    def rate(q, p):
        return p / mass, force(q)

    a = rate(q, p)
    b = rate(q + h / 2 * a[0], p + h / 2 * a[1])
    c = rate(q + h / 2 * b[0], p + h / 2 * b[1])
    d = rate(q + h * c[0], p + h * c[1])
    weights = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
    return tuple(
        x + h * sum(w * k[i] for w, k in zip(weights, (a, b, c, d), strict=True))
        for i, x in enumerate((q, p))
    )
