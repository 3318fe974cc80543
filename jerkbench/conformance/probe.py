"""A short check of a plugin from elsewhere before it runs, for faults that give a plausible table of wrong numbers.

It asks for less than `jerkbench.testing`, and takes hundredths of a second: a plugin that passes may still be wrong.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import FrozenInstanceError
from functools import lru_cache

import numpy as np

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.conformance.adaptation import probe_adaptation
from jerkbench.conformance.filters import axis_model_of, require_initial_variances
from jerkbench.conformance.plugin import checked_attitude, checked_disturbance, checked_values
from jerkbench.conformance.requirements import Plugin, Unfit, changes_itself, pure_result, require, require_methods
from jerkbench.conformance.samples import small_recording, small_timeline, true_attitude
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate
from jerkbench.filters.baseline import Baseline
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.plugins import create

SHORT_S, LONG_S = 8.0, 60.0
"""Of recordings to try a plugin on: for what goes through every sample, and for disturbances, which need room."""


def complaint(kind: str, plugin: Hashable) -> str:
    """Return what is the matter with ``plugin``, in a sentence; empty where nothing is."""
    try:
        return _complaint(kind, plugin)
    except TypeError as error:
        return f"{type(plugin).__name__} is not hashable ({error}); a field that is a list must be a tuple."


@lru_cache(maxsize=1024)
def _complaint(kind: str, plugin: Hashable) -> str:
    """Say it once for each plugin with its parameters; what a plugin raises here it raises again in its run."""
    try:
        require_methods(kind, plugin)
        PROBES[kind](plugin)
    except Unfit as error:
        return str(error)
    except FrozenInstanceError as error:
        return changes_itself(plugin, error)
    except Exception:  # noqa: BLE001 - a run over the user's data says what the matter is, or goes well
        return ""
    return ""


def _probe_filter(plugin: Plugin) -> None:
    subject = type(plugin).__name__
    if not isinstance(plugin, Filter):
        _probe_estimator(subject, plugin)
        return
    n = require_initial_variances(subject, plugin)
    for dt in (0.01, 0.01 / 3.0):
        axis_model_of(f"{subject}.axis_model({dt:g}, 0.01)", plugin, n, dt, 0.01)


def _probe_estimator(subject: str, plugin: Plugin) -> None:
    recording = small_recording(SHORT_S)
    adaptation = create("adaptation", {"name": plugin.adaptations[0]})
    estimate = pure_result(f"{subject}.estimate()", plugin.estimate, recording, true_attitude(recording), adaptation)
    _require_estimate(f"{subject}.estimate()", estimate)


def _probe_engine(plugin: Plugin) -> None:
    subject, (_, timeline) = f"{type(plugin).__name__}.run()", small_timeline(SHORT_S)
    _require_estimate(subject, pure_result(subject, plugin.run, timeline, Baseline(), NoAdaptation()))


def _require_estimate(subject: str, estimate: object) -> None:
    require(isinstance(estimate, Estimate), f"{subject} gives a {type(estimate).__name__}; it must be an Estimate.")


def _probe_metric(plugin: Plugin) -> None:
    recording = small_recording(SHORT_S)
    estimate = GnssOnly().estimate(recording, true_attitude(recording), NoAdaptation())
    checked_values(type(plugin).__name__, plugin, estimate, recording, np.ones(len(estimate.index), dtype=bool))


PROBES: Mapping[str, Callable[[Plugin], object]] = {
    "dataset": lambda _: None,  # to load it twice may take minutes
    "disturbance": lambda it: checked_disturbance(type(it).__name__, it, small_recording(LONG_S), 0),
    "attitude": lambda it: checked_attitude(type(it).__name__, it, small_recording(SHORT_S)),
    "filter": _probe_filter,
    "adaptation": probe_adaptation,
    "engine": _probe_engine,
    "metric": _probe_metric,
}
