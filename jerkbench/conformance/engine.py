"""The check of an engine: agreement with the reference engine."""

from typing import Any

import numpy as np

from jerkbench.adaptation.mtf import Mtf
from jerkbench.conformance.kinematic import check_estimate
from jerkbench.conformance.methods import require_methods
from jerkbench.conformance.recordings import small_recording, true_attitude
from jerkbench.conformance.require import require
from jerkbench.conformance.same import pure_result
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.filters.jerk import Jerk
from jerkbench.timeline.timeline import build_timeline

AGREEMENT_M = 1e-6


def check_engine(plugin: Any) -> None:  # noqa: ANN401 - the plugin under test
    """Check an engine: a run of the jerk filter with mtf agrees with the reference engine.

    Raises:
        AssertionError: it does not.
    """
    subject = type(plugin).__name__
    require_methods("engine", plugin)
    recording = small_recording()
    timeline = build_timeline(recording, true_attitude(recording))
    estimate = pure_result(f"{subject}.run()", plugin.run, timeline, Jerk(), Mtf())
    check_estimate(subject, estimate)
    wanted = FilterpyEngine().run(timeline, Jerk(), Mtf())
    require(np.array_equal(estimate.index, wanted.index), f"{subject} reaches other rows than the reference engine.")
    difference = max(
        np.abs(estimate.position_m - wanted.position_m).max(), np.abs(estimate.velocity_mps - wanted.velocity_mps).max()
    )
    require(
        difference <= AGREEMENT_M,
        f"{subject} is {difference:.3g} m (or m/s) off the reference engine; {AGREEMENT_M:g} is allowed.",
    )
