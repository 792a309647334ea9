"""Normal modes of coupled oscillators, from the map of all coordinates together.

The blocks of every scheme's one-step matrix are functions of the springs' matrix, and share its eigenvectors,
along which each mode moves by itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.identify.record import Record
from springcheck.physics.arrays import Extended

SPARE = 6
"""Degrees of freedom of each row that a map of all coordinates has to leave."""

ALIKE = 1e-5
"""Relative difference of eigenvalues below which any combination of two modes is one."""


def least_squares(columns: Extended, right: Extended) -> Extended:
    """Solution x of columns x = right by normal equations in extended precision."""
    size = np.sqrt(np.sum(columns**2, axis=0))
    size = np.where(size > 0, size, 1)
    columns = columns / size
    gram = columns.T @ columns
    inverse = np.linalg.pinv(gram.astype(np.float64), rcond=1e-15, hermitian=True).astype(np.longdouble)
    x = inverse @ (columns.T @ right)
    for _ in range(4):
        x = x + inverse @ (columns.T @ (right - columns @ x))
    return np.asarray(x / size[:, None])


def modes(record: Record, chosen: list[int]) -> tuple[Record, float] | None:
    """Positions and velocities of the normal modes of the chosen coordinates as a record, and the root mean
    square residual of the map (2m, 2m) of all coordinates together, relative to the states; None where frames
    are too few, or no modes are found."""
    z = np.concatenate([record.q[:, chosen], record.v[:, chosen] * record.interval], axis=1)
    frames, n = len(z), len(chosen)
    if frames - 1 < 2 * n + 1 + SPARE:
        return None
    size = np.sqrt(np.mean(z**2, axis=0)).astype(np.float64)
    # one size for all positions, one for all velocities: modes mix coordinates
    size = np.repeat([np.max(size[:n]), np.max(size[n:])], n)
    if not np.all(size > 0):
        return None
    scaled = z / size
    columns = np.concatenate([scaled[:-1], np.ones((frames - 1, 1), dtype=np.longdouble)], axis=1)
    x = least_squares(columns, scaled[1:])
    left = float(np.sqrt(np.mean((scaled[1:] - columns @ x).astype(np.float64) ** 2)))
    # the force's block: proportional to the springs' matrix for every scheme, to leading order in the step
    block = x[:-1].T[n:, :n]
    values, vectors = np.linalg.eig(block.astype(np.float64))
    if np.max(np.abs(np.imag(vectors))) > 1e-6 or np.linalg.cond(np.real(vectors)) > 1e6:
        return None
    basis = np.real(vectors).astype(np.longdouble)
    spread = np.real(values)
    gap = spread[None, :] - spread[:, None]
    far = np.abs(gap) > ALIKE * np.max(np.abs(spread))
    for _ in range(3):
        # eigenvectors of double precision, corrected to first order with what they leave off the diagonal
        inside = _inverse(basis) @ block @ basis
        basis = basis @ (np.eye(n) + np.where(far, inside / np.where(far, gap, 1), 0) * (1 - np.eye(n)))
    inverse = _inverse(basis)
    q = record.q[:, chosen] @ inverse.T
    v = record.v[:, chosen] @ inverse.T
    spreading = np.abs(inverse).astype(np.float64)
    return (
        replace(
            record,
            q=q,
            v=v,
            q_quantum=record.q_quantum[:, chosen] @ spreading.T,
            v_quantum=record.v_quantum[:, chosen] @ spreading.T,
            parts=(
                np.abs(record.q[:, chosen]).astype(np.float64) @ spreading.T,
                np.abs(record.v[:, chosen]).astype(np.float64) @ spreading.T,
            ),
            mass=None,
            momenta=False,
        ),
        left,
    )


def _inverse(x: Extended) -> Extended:
    """Inverse in extended precision: that of double precision, refined by Newton's iteration."""
    out = np.linalg.inv(x.astype(np.float64)).astype(np.longdouble)
    for _ in range(2):
        out = out @ (2 * np.eye(len(x)) - x @ out)
    return np.asarray(out)
