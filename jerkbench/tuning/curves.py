"""Curves over the trials of a search, and their figure: profiles, the budget, settings that cannot be told apart."""

from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.tuning.evaluate import Trials
from jerkbench.tuning.search import SearchOutcome, Tuning
from jerkbench.tuning.space import Space

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOKS = (1, 4, 16, 64, 256, 1024)
"""Budgets at which the curve is read."""

BINS = 8
"""Parts of a knob's range in its profile; of two knobs in their map as many on each side."""


def budget_curve(trials: Trials) -> list[tuple[int, float]]:
    """Return (trials, loss of the best of them) after 1, 4, 16, ... and all trials; after 1: before the search."""
    best = np.minimum.accumulate(trials.means)
    sizes = [*(size for size in LOOKS if size < len(best)), len(best)]
    return [(size, float(best[size - 1])) for size in sizes]


def profile(space: Space, trials: Trials, knob: int) -> tuple[FloatArray, FloatArray]:
    """Return the middles (b,) of parts of a knob's range, in its unit, and the least loss (b,) of a trial in each.

    NaN where no trial lies.
    """
    share = shares(space, trials)[:, knob]
    part = np.minimum((BINS * share).astype(np.int64), BINS - 1)
    least = [trials.means[part == k].min(initial=np.inf) for k in range(BINS)]
    middles = [space.knobs[knob].bounds.value((k + 0.5) / BINS) for k in range(BINS)]
    return np.array(middles), np.where(np.isfinite(least), least, np.nan)


def loss_map(space: Space, trials: Trials, first: int, second: int) -> FloatArray:
    """Return (b, b) the least loss of a trial in each part of two knobs' ranges: rows by the first; NaN: none."""
    both = np.minimum((BINS * shares(space, trials)[:, [first, second]]).astype(np.int64), BINS - 1)
    least = np.full((BINS, BINS), np.inf)
    np.minimum.at(least, (both[:, 0], both[:, 1]), trials.means)
    return np.where(np.isfinite(least), least, np.nan)


def shares(space: Space, trials: Trials) -> FloatArray:
    """Return (n, d) how much of the way through each range the values are."""
    return np.array([[k.share(v) for k, v in zip(space.knobs, setting, strict=True)] for setting in trials.settings])


def importance(space: Space, trials: Trials) -> list[int]:
    """Return the knobs by how much their profile varies, the most first."""
    profiles = (profile(space, trials, k)[1] for k in range(len(space.knobs)))
    spread = [np.nan_to_num(np.ptp(least[np.isfinite(least)])) for least in profiles]
    return [int(k) for k in np.argsort(spread, kind="stable")[::-1]]


def indistinct(outcome: SearchOutcome) -> list[int]:
    """Return the places of the trials that cannot be told from the chosen one.

    Their mean loss over the runs (the same draws: paired) is no larger than by 1.96 standard errors of the difference.
    """
    trials = outcome.trials
    difference = trials.runs - trials.runs[outcome.place]
    error = difference.std(axis=1, ddof=1) / np.sqrt(difference.shape[1]) if difference.shape[1] > 1 else np.zeros(1)
    return [int(k) for k in np.flatnonzero(difference.mean(axis=1) <= 1.96 * error)]


def knob_intervals(space: Space, outcome: SearchOutcome) -> list[tuple[float, float]]:
    """Return for each knob the least and the largest value that cannot be told from the chosen one.

    Those of `indistinct` trials, and beyond them half of the distance at which n trials lie in d dimensions, n^(-1/d)
    of the range: between two trials nothing was tried.
    """
    share = shares(space, outcome.trials)
    near, half = share[indistinct(outcome)], 0.5 * len(share) ** (-1.0 / len(space.knobs))
    low, high = np.maximum(near.min(axis=0) - half, 0.0), np.minimum(near.max(axis=0) + half, 1.0)
    return [(k.bounds.value(a), k.bounds.value(b)) for k, a, b in zip(space.knobs, low, high, strict=True)]


def tuning_figure(tuning: Tuning) -> "Figure":
    """Draw the profile of each knob, the map of the two that matter most, and the curve of the budget."""
    from jerkbench.report.plots.sweeps import Map, Profile, search_figure

    space, trials, drawn = tuning.space, tuning.outcome.trials, None
    profiles = [
        Profile(knob.name, values, *profile(space, trials, k), tuning.setting[k], knob.bounds.log)
        for k, (knob, values) in enumerate(zip(space.knobs, np.array(trials.settings).T, strict=True))
    ]
    if len(space.knobs) > 1:
        first, second = importance(space, trials)[:2]
        chosen = [space.knobs[k].share(tuning.setting[k]) for k in (first, second)]
        least = loss_map(space, trials, first, second)
        drawn = Map(space.names[first], space.names[second], least, (chosen[0], chosen[1]))
    title = f"{tuning.name}: {tuning.effort.objective.name}, {len(trials)} settings"
    return search_figure(profiles, trials.means, drawn, budget_curve(trials), title)
