"""NEES, NIS and the likelihood of innovations, compared with naive loops."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import Updates
from jerkbench.evaluation.metrics.consistency import Consistency, InnovationLikelihood
from jerkbench.filters.kinematic import ConstantVelocity
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest, with_fix_noise

BURN_IN_S = 5.0


def naive_nees(estimate, recording, counted, size):
    values = []
    for k, row in enumerate(estimate.index):
        truth = np.concatenate([recording.reference.enu_m[row], recording.reference.velocity_mps[row]])[:size]
        state = np.concatenate([estimate.position_m[k], estimate.velocity_mps[k]])[:size]
        if counted[k] and np.isfinite(truth).all():
            error = state - truth
            values.append(error @ np.linalg.inv(estimate.covariance[k][:size, :size]) @ error)
    return sum(values) / len(values)


@pytest.mark.parametrize("holes", [{}, {"enu_m": 0}, {"velocity_mps": 2}])
@pytest.mark.parametrize(("column", "size"), [("anees", 6), ("anees_position", 3)])
def test_anees_is_the_naive_loop(estimate, recording, counted, column, size, holes):
    """Without values of the reference on one axis for nine seconds."""
    for name, axis in holes.items():
        values = getattr(recording.reference, name).copy()
        values[12:30, axis] = np.nan
        recording = dataclasses.replace(recording, reference=dataclasses.replace(recording.reference, **{name: values}))
    expected = naive_nees(estimate, recording, counted, size)
    estimate.covariance.flags.writeable = False
    assert Consistency().evaluate(estimate, recording, counted)[column] == pytest.approx(expected, rel=1e-9)


def test_anis_is_the_naive_loop_over_the_updates_after_the_burn_in_and_dropped_rows_do_not_count(
    estimate, recording, counted
):
    u = estimate.updates
    terms = [nis / rows for t, nis, rows in zip(u.t_s, u.nis, u.rows, strict=True) if t >= BURN_IN_S]
    values = Consistency().evaluate(estimate, recording, counted)
    assert 0 < len(terms) < len(u.t_s)
    assert values["anis_per_row"] == pytest.approx(sum(terms) / len(terms), rel=1e-12)
    R_diagonal, nis_used = u.R_diagonal.copy(), u.nis_used.copy()
    whole, half = np.flatnonzero((u.rows == 6) & (u.t_s >= BURN_IN_S))[:2]
    R_diagonal[whole], nis_used[whole] = np.inf, np.nan
    R_diagonal[half, :3] = np.inf
    changed = dataclasses.replace(u, R_diagonal=R_diagonal, nis_used=nis_used)
    terms = []
    for k, t in enumerate(u.t_s):
        kept = sum(1 for value in R_diagonal[k] if math.isfinite(value))
        if t >= BURN_IN_S and kept:
            terms.append(nis_used[k] / kept)
    values = Consistency().evaluate(dataclasses.replace(estimate, updates=changed), recording, counted)
    assert values["anis_used_per_row"] == pytest.approx(sum(terms) / len(terms), rel=1e-12)


SPOILT = np.diag([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("bad", "of_position"),
    [(-np.eye(6), True), (np.full((6, 6), np.nan), True), (np.zeros((6, 6)), True), (SPOILT, False)],
)
def test_a_covariance_that_is_not_positive_definite_gives_nan(estimate, recording, counted, bad, of_position):
    covariance = estimate.covariance.copy()
    covariance[40] = bad
    values = Consistency().evaluate(dataclasses.replace(estimate, covariance=covariance), recording, counted)
    assert math.isnan(values["anees"])
    assert math.isnan(values["anees_position"]) == of_position


ENGINES = [CompiledEngine(), FilterpyEngine()]


def noisy(missing=False):
    recording = with_fix_noise(recording_at_rest(duration_s=2.0))
    z_p, z_v = recording.position.enu_m.copy(), recording.velocity.mps.copy()
    if missing:
        z_v[3:5], z_p[6] = np.nan, np.nan
    position = dataclasses.replace(recording.position, enu_m=z_p)
    return dataclasses.replace(recording, position=position, velocity=dataclasses.replace(recording.velocity, mps=z_v))


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
