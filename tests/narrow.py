"""`long double` as it is on Apple silicon and on Windows: no wider than double.

    PYTHONPATH=tests python -m pytest -p narrow

It must be loaded before anything of springcheck is.
"""

import numpy as np

np.longdouble = np.float64  # type: ignore[misc,assignment]
