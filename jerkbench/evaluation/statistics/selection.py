"""The winner's curse: what the best of several settings is worth on seeds that did not choose it."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Chosen:
    """The best of k settings.

    Attributes:
        best: index of the lowest over all seeds.
        picked: (n,) index that the other seeds choose for each seed.
        values: (n,) the error of each seed with the setting that the others chose.
        optimism: mean log of these over those of ``best``: by so much the best's own seeds flatter it.
    """

    best: int
    picked: IntArray
    values: FloatArray
    optimism: float


def chosen_on_other_seeds(errors: FloatArray) -> Chosen:
    """Return the best of (k, n) errors of k settings on n seeds, each seed scored by what the others choose.

    The lowest mean log is the best; a setting with fewer lost (infinite) runs goes before. Of one seed there is no
    other: it chooses for itself.

    Source: Stone, "Cross-validatory choice and assessment of statistical predictions", JRSS B 36 (1974).
    """
    lost = np.isinf(errors)
    logs = np.log(np.where(lost, 1.0, np.maximum(errors, np.finfo(float).tiny)))
    best = _best(lost.sum(axis=1)[:, None], logs.sum(axis=1)[:, None], (~lost).sum(axis=1)[:, None])[0]
    if errors.shape[1] < 2:
        return Chosen(int(best), np.full(errors.shape[1], best), errors[best], 0.0)
    others = (lost.sum(axis=1, keepdims=True) - lost, logs.sum(axis=1, keepdims=True) - logs)
    picked = _best(*others, (~lost).sum(axis=1, keepdims=True) - ~lost)
    values = errors[picked, np.arange(errors.shape[1])]
    both = np.isfinite(values) & np.isfinite(errors[best])
    optimism = float(np.mean(np.log(values[both] / errors[best][both]))) if both.any() else np.nan
    return Chosen(int(best), picked, values, optimism)


def _best(lost: FloatArray, total: FloatArray, count: FloatArray) -> IntArray:
    """Return (n,) the setting with the fewest lost runs, and of these the lowest mean log."""
    mean = total / np.maximum(1, count)
    candidates = np.where(lost == lost.min(axis=0), mean, np.inf)
    return np.asarray(np.argmin(candidates, axis=0), dtype=np.int64)
