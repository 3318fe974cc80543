"""What an engine has to fulfil: agree with the reference engine."""

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


def check_engine(plugin: Any) -> None:  # noqa: ANN401 - it is what is being checked
    """Check an engine: a run of the jerk filter with mtf agrees with the reference engine.

    Raises:
        AssertionError: it does not.
    """
    what = type(plugin).__name__
    require_methods("engine", plugin)
    recording = small_recording()
    timeline = build_timeline(recording, true_attitude(recording))
    got = pure_result(f"{what}.run()", plugin.run, timeline, Jerk(), Mtf())
    check_estimate(what, got)
    wanted = FilterpyEngine().run(timeline, Jerk(), Mtf())
    require(np.array_equal(got.index, wanted.index), f"{what} reaches other rows than the reference engine.")
    apart = max(np.abs(got.position_m - wanted.position_m).max(), np.abs(got.velocity_mps - wanted.velocity_mps).max())
    require(
        apart <= AGREEMENT_M, f"{what} is {apart:.3g} m (or m/s) off the reference engine; {AGREEMENT_M:g} is allowed."
    )
