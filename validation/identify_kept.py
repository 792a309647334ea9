"""The cases of `identify_corpus.py` as they are made: their rows, and their numbers in two flat arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.physics.arrays import Floats

ROWS: list[dict[str, Any]] = []
STATES: dict[str, list[Floats]] = {"float64": [], "float32": []}


def stored(x: Floats) -> dict[str, Any]:
    """Put numbers into the file, in single precision where that holds them: where they are."""
    with np.errstate(over="ignore", under="ignore"):
        width = "float32" if np.array_equal(x.astype(np.float32), x) else "float64"
    parts = STATES[width]
    at = sum(part.size for part in parts)
    parts.append(np.ravel(x).astype(width))
    return {"width": width, "at": [at, *x.shape]}


def add(
    group: str,
    name: str,
    truth: str,
    t: Floats | dict[str, Any],
    q: Any,
    v: Any = None,
    *,
    p: Any = None,
    wanted: str = "named",
    schemes: tuple[str, ...] = (),
    stride: int | None = 1,
    says: str = "",
    true: tuple[str, ...] = (),
    facts: dict[str, Any] | None = None,
    share: str = "",
    column: int | None = None,
    **stated: Any,
) -> None:
    """Keep a case; with `share` its states are those of another, or one `column` of them."""
    arrays: dict[str, Any] = {}
    for key, x in (("t", t), ("q", q), ("v", v), ("p", p)):
        if isinstance(x, dict):
            arrays[key] = x
        elif x is not None and share:
            arrays[key] = next(row for row in ROWS if row["name"] == share)["arrays"][key]
            if column is not None:
                arrays[key] = {**arrays[key], "column": column}
        elif x is not None:
            arrays[key] = stored(np.asarray(x, np.float64))
    ROWS.append(
        {
            "name": name,
            "group": group,
            "truth": truth,
            "arrays": arrays,
            "stated": stated,
            "wanted": wanted,
            "schemes": list(schemes),
            "stride": stride,
            "says": says,
            "true": list(true),
            "today": "",
            "facts": facts or {},
        }
    )


def even(h: float, frames: int, every: int = 1) -> dict[str, Any]:
    """Times n h."""
    return {"kind": "even", "h": h, "frames": frames, "every": every}


def digits(x: Floats, form: str) -> Floats:
    """Numbers written as text and read back."""
    return np.array([float(form % y) for y in x.ravel()]).reshape(x.shape)
