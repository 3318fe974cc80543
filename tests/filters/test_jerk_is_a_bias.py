"""The jerk state as a bias: the control experiment, on the nominal field with the defaults of both filters."""

import numpy as np

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.filters.kinematic import Baseline, Bias, Jerk
from jerkbench.timeline import build_timeline


def test_jerk_and_bias_agree_to_a_millimetre_on_the_nominal_field():
    recording = FieldWhite().load(0)
    timeline = build_timeline(recording, Tilt().estimate(recording))
    jerk, bias, baseline = (
        CompiledEngine().run(timeline, model, NoAdaptation()).position_m for model in (Jerk(), Bias(), Baseline())
    )

    assert np.linalg.norm(jerk - bias, axis=1).max() < 1e-3
    assert np.linalg.norm(jerk - baseline, axis=1).max() > 1e-2
