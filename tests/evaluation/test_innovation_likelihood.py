"""The innovations' likelihood is that of the measurements under the filter's own Gaussian, in both engines."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import Updates
from jerkbench.evaluation.metrics.consistency import InnovationLikelihood
from jerkbench.filters.kinematic import ConstantVelocity
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest

ENGINES = [CompiledEngine(), FilterpyEngine()]


def noisy(missing=False):
    recording = recording_at_rest(duration_s=2.0)
    p, v, rng = recording.position, recording.velocity, np.random.default_rng(2)
    z_p = p.enu_m + 0.01 * rng.standard_normal(p.enu_m.shape)
    z_v = v.mps + 0.03 * rng.standard_normal(v.mps.shape)
    if missing:
        z_v[3:5], z_p[6] = np.nan, np.nan
    position, velocity = dataclasses.replace(p, enu_m=z_p), dataclasses.replace(v, mps=z_v)
    return dataclasses.replace(recording, position=position, velocity=velocity)


def naive_loss(timeline, model):
    """A plain loop over the timeline, with the density of SciPy."""
    x, P, losses = timeline.x0.copy(), timeline.P0.copy(), []
    for dt, update in zip(timeline.dt_s, timeline.update, strict=True):
        if dt > 0:
            A, _, Q = model.axis_model(dt, timeline.dt0_s)
            F = np.kron(A, np.eye(3))
            x, P = F @ x, F @ P @ F.T + np.kron(Q, np.eye(3))
        if update >= 0:
            z, R = timeline.measurements.z[update], timeline.measurements.R[update]
            rows = np.flatnonzero(np.isfinite(z))
            H = np.eye(6)[rows]
            S = H @ P @ H.T + R[np.ix_(rows, rows)]
            losses.append(-multivariate_normal(H @ x, S).logpdf(z[rows]))
            K = P @ H.T @ np.linalg.inv(S)
            x, P = x + K @ (z[rows] - H @ x), P - K @ S @ K.T
    return np.mean(losses)


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: type(engine).__name__)
def test_it_is_the_mean_negative_log_density_of_the_measurements(engine, missing):
    recording, model = noisy(missing), ConstantVelocity()
    timeline = build_timeline(recording, level_attitude(recording))
    estimate = engine.run(timeline, model, NoAdaptation())
    counted = np.ones(len(estimate.index), dtype=bool)

    values = InnovationLikelihood().evaluate(estimate, recording, counted)

    assert values == {"innovation_log_loss": pytest.approx(naive_loss(timeline, model), rel=1e-9)}


def test_an_estimator_that_keeps_no_determinant_has_no_value():
    updates = Updates(np.ones(2), np.full(2, 6.0), np.ones(2), np.ones(2), np.ones((2, 6)), np.ones((2, 6)))
    recording = noisy()
    timeline = build_timeline(recording, level_attitude(recording))
    estimate = CompiledEngine().run(timeline, ConstantVelocity(), NoAdaptation())
    estimate = dataclasses.replace(estimate, updates=updates)

    values = InnovationLikelihood().evaluate(estimate, recording, np.ones(len(estimate.index), dtype=bool))

    assert np.isnan(values["innovation_log_loss"])
