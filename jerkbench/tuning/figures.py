"""The figure of a tuning, from its trials."""

import numpy as np
from matplotlib.figure import Figure

from jerkbench.report.plots.sweeps import Map, Profile, search_figure
from jerkbench.tuning.curves import budget_curve, importance, loss_map, profile
from jerkbench.tuning.outcome import Tuning


def tuning_figure(tuning: Tuning) -> Figure:
    """Draw the profile of each knob, the map of the two that matter most, and the curve of the budget."""
    trials, space = tuning.outcome.trials, tuning.space
    profiles = [_profile(tuning, k) for k in range(len(space.knobs))]
    title = f"{tuning.name}: {tuning.effort.objective.name}, {len(trials)} settings"
    return search_figure(profiles, trials.means, _map(tuning), budget_curve(trials), title)


def _profile(tuning: Tuning, k: int) -> Profile:
    knob, trials = tuning.space.knobs[k], tuning.outcome.trials
    values = np.array([setting[k] for setting in trials.settings])
    middles, least = profile(tuning.space, trials, k)
    return Profile(knob.name, values, middles, least, tuning.setting[k], knob.bounds.log)


def _map(tuning: Tuning) -> Map | None:
    """The map of the two knobs whose profiles vary most; None where there is one knob."""
    space = tuning.space
    if len(space.knobs) < 2:
        return None
    first, second = importance(space, tuning.outcome.trials)[:2]
    chosen = [space.knobs[k].share(tuning.setting[k]) for k in (first, second)]
    least = loss_map(space, tuning.outcome.trials, first, second)
    return Map(space.names[first], space.names[second], least, (chosen[0], chosen[1]))
