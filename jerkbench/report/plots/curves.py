"""Curves over time: thinned to what a pixel shows, those that coincide found."""

from collections.abc import Iterable, Mapping

import numpy as np

from jerkbench.arrays import FloatArray

COLUMNS = 1000
"""Pixels of a figure's width; of each the lowest and the highest value are kept."""

COINCIDE = 0.01
"""Curves that are nowhere further apart than this share of the larger one are one line for the eye."""


def thinned(t_s: FloatArray, values: FloatArray, columns: int = COLUMNS) -> tuple[FloatArray, FloatArray]:
    """Return times and values of a curve with at most two points a column: the lowest and the highest.

    A value that is not known ends the line, and stays. What is short enough is returned as it is.
    """
    if len(t_s) <= 2 * columns:
        return t_s, values
    edges = np.searchsorted(t_s, np.linspace(t_s[0], t_s[-1], columns + 1)[:-1])
    starts = np.unique(edges)
    known = np.isfinite(values)
    places = [
        _extremes(np.where(known, values, fill), starts, function)
        for fill, function in ((np.inf, np.minimum), (-np.inf, np.maximum))
    ]
    gaps = np.flatnonzero(~known & np.r_[True, known[:-1]])
    kept = np.unique(np.concatenate([[0, len(t_s) - 1], *places, gaps]))
    return t_s[kept], values[kept]


def with_gaps(t_s: FloatArray, values: FloatArray, longest: float = 3.0) -> tuple[FloatArray, FloatArray]:
    """Return a curve with an unknown value wherever two times are more than ``longest`` median steps apart."""
    steps = np.diff(t_s)
    places = np.flatnonzero(steps > longest * np.median(steps)) + 1 if len(steps) else np.empty(0, dtype=int)
    return np.insert(t_s, places, t_s[places - 1]), np.insert(values, places, np.nan)


def _extremes(values: FloatArray, starts: np.ndarray, function: np.ufunc) -> np.ndarray:
    """Return the first place of the extreme of each part that begins at ``starts``."""
    extremes = function.reduceat(values, starts)
    lengths = np.diff(np.r_[starts, len(values)])
    hits = np.flatnonzero((values == np.repeat(extremes, lengths)) & np.isfinite(values))
    parts = np.searchsorted(starts, hits, side="right") - 1
    return hits[np.unique(parts, return_index=True)[1]]


def coinciding(curves: Mapping[str, FloatArray]) -> list[list[str]]:
    """Return the names of curves in groups that coincide within `COINCIDE`, each with the first of its group."""
    groups: list[list[str]] = []
    for name, values in curves.items():
        group = next((names for names in groups if _coincide(curves[names[0]], values)), None)
        if group is None:
            groups.append([name])
        else:
            group.append(name)
    return groups


def _coincide(first: FloatArray, second: FloatArray) -> bool:
    if first.shape != second.shape or not np.array_equal(np.isfinite(first), np.isfinite(second)):
        return False
    known = np.isfinite(first)
    with np.errstate(over="ignore"):
        largest = np.maximum(np.abs(first[known]), np.abs(second[known]))
        return bool(np.all(np.abs(first[known] - second[known]) <= COINCIDE * largest))


def joined(names: Iterable[str]) -> str:
    """Return the label of curves that coincide."""
    return " = ".join(names)
