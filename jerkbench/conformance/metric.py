"""The checks of a metric."""

from typing import Any

import numpy as np

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import BoolArray
from jerkbench.conformance.methods import require_methods
from jerkbench.conformance.recordings import small_recording, true_attitude
from jerkbench.conformance.require import require
from jerkbench.conformance.same import pure_result
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import Estimate
from jerkbench.filters.baseline import Baseline
from jerkbench.recording import Recording
from jerkbench.timeline.timeline import build_timeline


def check_metric(plugin: Any) -> None:  # noqa: ANN401 - the plugin under test
    """Check a metric on a small run: all rows counted, few, none.

    Raises:
        AssertionError: the values are no floats by name, or the names depend on the run.
    """
    subject = type(plugin).__name__
    require_methods("metric", plugin)
    recording = small_recording()
    estimate = FilterpyEngine().run(build_timeline(recording, true_attitude(recording)), Baseline(), NoAdaptation())
    every = np.ones(len(estimate.index), dtype=bool)
    names = list(checked_values(subject, plugin, estimate, recording, every))
    require(names, f"{subject}.evaluate() gives no value.")
    for counted in (estimate.index > estimate.index[-10], ~every):
        fewer = list(checked_values(subject, plugin, estimate, recording, counted))
        require(
            fewer == names,
            f"{subject}.evaluate() names {fewer} where fewer rows count, and {names} where all do; a value that does"
            " not apply is NaN.",
        )


def checked_values(
    subject: str,
    plugin: Any,  # noqa: ANN401 - as above
    estimate: Estimate,
    recording: Recording,
    counted: BoolArray,
) -> dict[str, float]:
    """Return what the metric gives, checked for names and numbers, and for being the same the second time."""
    values: dict[str, float] = pure_result(f"{subject}.evaluate()", plugin.evaluate, estimate, recording, counted)
    require(isinstance(values, dict), f"{subject}.evaluate() gives a {type(values).__name__}; it must be a dictionary.")
    for name, value in values.items():
        require(isinstance(name, str), f"{subject}.evaluate() has the name {name!r}; it must be a string.")
        require(isinstance(value, float), f"{subject}.evaluate(): {name} is {value!r}; it must be a float.")
    return values
