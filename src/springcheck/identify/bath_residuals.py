"""What a linear map of states leaves: whether it is draws, or a force, a factor, digits or a joint."""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial.legendre import Legendre

from springcheck.bath.evidence import of_normal, shape
from springcheck.physics.arrays import Floats

FACTOR_LAGS = 20
"""Lags at which a factor of momenta that persists would show."""

FEWEST = 200
"""Fewest frames from which draws are inferred."""

WHITE = 1e-9
"""Chance below which residuals are not white, and so no draws but motion beyond one frame's map."""

EVEN = 1e-4
"""Chance below which noise on momenta may be a factor, and no draw is inferred from it."""

NEIGHBOURS_DIFFER = 0.8
"""Mean squared difference of the residuals of neighbouring states, over their variance, below which these
follow from the state: 2 of noise, 1 of one draw beside none, less than 0.1 of a smooth function."""

FEWEST_AGAIN = 40
"""Fewest numbers of which an exact repetition shows: their sum of squares is sqrt(40) standard deviations."""

UNIFORM = "uniform, not normal"

JOINED_FROM = 6.0
"""Standard deviations of a correlation from which on particles are joined: 2e-9 of those that are not."""


def follows(left: Floats, beside: Floats, known: Floats) -> bool:
    """Whether the residual of a map of what is `known` (f, k) depends on more, as on others (f, others)."""
    for x in beside.T:
        rest = x - known @ np.linalg.lstsq(known, x, rcond=None)[0]
        size = float(np.linalg.norm(rest))
        if size > 0 and abs(float(rest @ left)) > JOINED_FROM * size:
            return True
    return False


def left_of(z: Floats, beside: Floats) -> tuple[Floats, Floats]:
    """Residuals of the best linear map of states and further regressors (k, f-1): their standard deviations
    (2,), and over these (2, f-1)."""
    known = np.concatenate([z[:, :-1], beside, np.ones((1, z.shape[1] - 1))]).T
    left = (z[:, 1:].T - known @ np.linalg.lstsq(known, z[:, 1:].T, rcond=None)[0]).T
    size = np.std(left, axis=1)
    return np.asarray(size), np.asarray(left / np.maximum(size, 1e-300)[:, None])


def is_added(noisy: Floats, left: Floats, u: Floats, every: int) -> bool:
    """Whether what is left is added to the momenta u - left, and no factor of them: its size says nothing of
    theirs, its sign over theirs nothing of that so many frames later, nor does what `noisy` numbers leave."""
    if len(u) < FEWEST * every:
        return False
    made = u - np.mean(u) - left
    large = [np.sign(np.abs(x) - np.median(np.abs(x))) for x in (left, made)]
    after = (np.sign(left * made), left / max(float(np.std(left)), 1e-300))
    chances = [neighbours(x[j::every]) for x in after for j in range(every)]
    chances += [together(x[j::every]) for x in noisy for j in range(every)]
    return min(_mean(large[0] * large[1]), *chances) > EVEN


def grows(left: Floats, *places: Floats) -> bool:
    """Whether the size of residuals (f,) goes with that of positions (f,), as where a force is off by a
    random factor: no scheme's noise does."""
    sizes = [np.abs(left), *(np.abs(x - np.mean(x)) for x in places)]
    first, *others = (np.sign(x - np.median(x)) for x in sizes)
    return min(_mean(first * x) for x in others) < WHITE


def is_white(x: Floats) -> bool:
    """Whether residuals (f,) tell nothing of later ones."""
    return min(neighbours(x), recurrence(x)) > WHITE


def is_of_digits(x: Floats) -> bool:
    """Whether residuals are rounding to digits: their size goes with a number's, their sign with nothing."""
    return is_white(np.sign(x - np.median(x)))


def of_state(left: Floats, x: Floats, u: Floats) -> bool:
    """Whether residuals (f,) follow from the states x, u (f,), of size 1, where they begin: neighbouring
    states then have nearly the same."""
    from scipy.spatial import cKDTree

    z = np.stack([x, u], axis=1)
    nearest = np.asarray(cKDTree(z).query(z, 2)[1])[:, 1]
    return bool(np.mean((left - left[nearest]) ** 2) < NEIGHBOURS_DIFFER * np.var(left))


def unlike_normal(x: Floats) -> str:
    """How draws (f,) of one size are not normal, in words; "" where none shows that they are not."""
    unlike, words = shape(x[:, None]).found
    if unlike > WHITE:
        return ""
    # the mean of a Legendre polynomial of degree d has the variance 1/(2 d + 1) over the draws
    u = x / np.max(np.abs(x))
    even = (float(np.mean(Legendre.basis(d)(u))) * math.sqrt((2 * d + 1) * len(u)) for d in (2, 4))
    return UNIFORM if all(of_normal(z) > WHITE for z in even) else f"not normal: {words}"


def is_correlated(x: Floats) -> bool:
    """Whether neighbours share something, and others nothing, as draws that act in two steps; what these
    leave of the best map fades in a few."""
    far = [abs(float(np.mean(x[lag:] * x[:-lag]))) for lag in range(6, 30)]
    return max(far) < 0.3


def regressed(known: Floats, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Regression of x (f,) on `known` (f, k): coefficients (k,), residuals (f,), standard errors (k,)."""
    entries = np.linalg.lstsq(known, x, rcond=None)[0]
    left = x - known @ entries
    # columns of very different size would cost the inverse its digits
    size = np.linalg.norm(known, axis=0)
    of = np.sqrt(np.diag(np.linalg.inv((known / size).T @ (known / size)))) / size
    return np.asarray(entries), np.asarray(left), np.asarray(np.std(left) * of)


def _mean(x: Floats) -> float:
    """Chance of the mean of x (f,), of variance 1."""
    return of_normal(float(np.sum(x)) / math.sqrt(len(x)))


def neighbours(x: Floats) -> float:
    """Chance of the correlation of x (f,) with the number before."""
    products = x[1:] * x[:-1]
    size = float(np.linalg.norm(products))
    return of_normal(float(np.sum(products)) / size) if size > 0 else 0.0


def recurrence(x: Floats) -> float:
    """Chance of the largest autocorrelation of x (f,) at any lag; 1 of a few."""
    lags = np.arange(2, len(x) - FEWEST_AGAIN)
    if len(x) < 1000 or not np.all(np.isfinite(x)):
        return 1.0
    sums = np.fft.irfft(np.abs(np.fft.rfft(x, 2 * len(x))) ** 2)[lags]
    both = len(x) - lags
    z = sums / np.sqrt(np.where(lags < both, both * np.mean(x * x), np.cumsum(x * x)[both - 1]))
    return min(1.0, 10 * len(lags) * of_normal(float(np.max(np.abs(z)))))


def together(x: Floats) -> float:
    """Chance of the correlations of x (f,) over `FACTOR_LAGS` steps together (Ljung & Box, Biometrika 65
    (1978) 297); 1 of a few."""
    from scipy.special import gammaincc

    n, size = len(x), float(x @ x)
    if n < 4 * FACTOR_LAGS:
        return 1.0
    squares = [float(x[j:] @ x[:-j]) ** 2 / (n - j) for j in range(1, FACTOR_LAGS + 1)]
    return float(gammaincc(FACTOR_LAGS / 2, n * (n + 2) * sum(squares) / size**2 / 2)) if size else 0.0
