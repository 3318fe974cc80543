"""The measured rows of an update: which are there, and which have a variance."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.arguments import Kept, Packed
from jerkbench.engines.compiled.places import KEPT, R, X, Y


def innovate(m: FloatArray, packed: Packed, z: FloatArray, which: int) -> int:
    """Fill y, kept and rows; return the number of rows that are there."""
    rows = 0
    for r in range(6):
        there = np.isfinite(z[which, r])
        m[KEPT + r] = 1.0 if there else 0.0
        m[Y + r] = z[which, r] - m[X + r] if there else 0.0
        if there:
            packed.rows[rows], packed.y[rows] = r, m[Y + r]
            rows += 1
    return rows


def take_reported(m: FloatArray, reported: FloatArray, which: int) -> None:
    """Put what the receiver reported into R, zero where a row is not there."""
    for r in range(6):
        for c in range(6):
            there = m[KEPT + r] * m[KEPT + c] > 0.0
            m[R + 6 * r + c] = reported[which, r, c] if there else 0.0


def take_adapted(m: FloatArray, packed: Packed, rows: int) -> None:
    """Put what the adaptation says of some rows into R, zero where a row is not there."""
    for e in range(36):
        m[R + e] = 0.0
    for i in range(rows):
        for j in range(rows):
            m[R + 6 * packed.rows[i] + packed.rows[j]] = packed.adapted[rows * i + j]


def keep_used(m: FloatArray, packed: Packed, kept: Kept, place: int, rows: int) -> int:
    """Keep innovation and variances; leave rows without a finite variance out, and return how many are left."""
    left = rows
    for i in range(rows):
        r = packed.rows[i]
        kept.innovation[place, r] = m[Y + r]
        kept.R[place, r] = m[R + 7 * r]
        if not np.isfinite(m[R + 7 * r]):
            left -= 1
            _drop(m, r)
    return left


def _drop(m: FloatArray, r: int) -> None:
    """Leave row ``r`` out of the update."""
    m[KEPT + r] = 0.0
    m[Y + r] = 0.0
    for c in range(6):
        m[R + 6 * r + c] = 0.0
        m[R + 6 * c + r] = 0.0
