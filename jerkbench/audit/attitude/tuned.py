"""Equal tuning, leaving one trial out, and what each method is worth then against another.

Each method is tuned 16 times. A tuning sees 16 of the 64 settings, the same numbers for all methods, and for each trial
takes the one with the lowest mean log error on the domain's other trials. The value of a trial is the median over the
tunings; trials are what is counted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.audit.attitude.methods import METHODS, SETTINGS
from jerkbench.audit.attitude.trials import DOMAINS
from jerkbench.evaluation.statistics.families import sign_p
from jerkbench.evaluation.statistics.intervals import quantiles_of_rows, student_interval

TUNINGS, EACH = 16, 16

LEVEL = 0.05

DomainErrors = Mapping[str, FloatArray]
"""By method, log of the error [deg] of each setting on each trial: (64, n), or (1, n) as it comes."""

TiltErrors = Mapping[str, DomainErrors]
"""By domain, those of its methods."""


def errors_of(rows: pd.DataFrame) -> TiltErrors:
    """Return the rows as arrays, trials in the order of their names."""
    there = set(rows["domain"])
    found: dict[str, dict[str, FloatArray]] = {domain: {} for domain in DOMAINS if domain in there}
    for (domain, method), own in rows.groupby(["domain", "method"]):
        table = own.pivot_table(index="setting", columns="trial", values="inclination_rmse_deg")
        found[str(domain)][str(method)] = np.log(table.to_numpy(dtype=np.float64))
    return found


def tried() -> list[IntArray]:
    """The settings that each tuning sees."""
    return [np.sort(np.random.default_rng(r).choice(SETTINGS, EACH, replace=False)) for r in range(TUNINGS)]


def chosen(loss: FloatArray, others: FloatArray | float = 0.0) -> IntArray:
    """Return (16, n) the setting that each tuning takes where a trial is left out.

    ``loss`` (64, n) counts by the mean over the trials that stay; ``others`` (64,) is added to it.
    """
    left = (loss.sum(axis=1, keepdims=True) - loss) / (loss.shape[1] - 1) + np.reshape(others, (-1, 1))
    return np.array([subset[left[subset].argmin(axis=0)] for subset in tried()])


def scored(loss: FloatArray, setting: IntArray) -> FloatArray:
    """Return (16, n) the loss of the settings on the trials that were left out."""
    return loss[setting, np.arange(loss.shape[1])]


def tuned(errors: DomainErrors) -> dict[str, FloatArray]:
    """Return (16, n) for each method that is tuned."""
    return {method: scored(errors[method], chosen(errors[method])) for method in METHODS}


def holm(p: Sequence[float]) -> list[float]:
    """Return the p adjusted for all of them (Holm 1979)."""
    order, adjusted, largest = np.argsort(p, kind="stable"), [0.0] * len(p), 0.0
    for rank, k in enumerate(order):
        largest = max(largest, min(1.0, (len(p) - rank) * p[k]))
        adjusted[k] = largest
    return adjusted


@dataclass(frozen=True)
class TiltVerdict:
    """A method against another one; ratios of errors, below 1 is better.

    Attributes:
        mean: geometric mean over trials, and the ends of Student's 95 % interval.
        median: over trials, and the ends of its 95 % interval.
        wins: on how many trials it is better.
        n: of how many.
        p: of the sign test, adjusted for all methods.
        word: better, worse or undecided, at 5 %.
    """

    mean: tuple[float, float, float]
    median: tuple[float, float, float]
    wins: int
    n: int
    p: float
    word: str


def tilt_verdicts(losses: Mapping[str, FloatArray], comparator: str) -> dict[str, TiltVerdict]:
    """Return the verdict on each other method, from (16, n) losses."""
    d = {name: np.median(loss - losses[comparator], axis=0) for name, loss in losses.items() if name != comparator}
    p = holm([sign_p(int((own < 0).sum()), int((own > 0).sum())) for own in d.values()])
    return {name: _verdict(own, adjusted) for (name, own), adjusted in zip(d.items(), p, strict=True)}


def _verdict(d: FloatArray, p: float) -> TiltVerdict:
    median, low, high, *_ = (float(value[0]) for value in quantiles_of_rows(d[None]))
    word = "undecided" if p >= LEVEL else "better" if median < 0 else "worse"
    mean = float(d.mean()), *student_interval(d, 0.95)
    first, second = (tuple(np.exp(values).tolist()) for values in (mean, (median, low, high)))
    return TiltVerdict(first, second, int((d < 0).sum()), len(d), p, word)
