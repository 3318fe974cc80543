"""The smoother against filterpy, and against the least-squares solution of the complete run."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import PluginError
from jerkbench.estimate import no_attitude
from jerkbench.filters.rts import RauchTungStriebel, SmoothedFixes
from jerkbench.recording import Position, Recording, Reference
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest, with_fix_noise

MODELS = ("baseline", "bias", "jerk", "constant_velocity", "acceleration")


def smoother_of(model):
    return (SmoothedFixes if model in ("constant_velocity", "acceleration") else RauchTungStriebel)(model)


def noisy_recording(**options):
    return with_fix_noise(recording_at_rest(**options))


def model_matrices(model, dt, dt0):
    A, b, Q = model.axis_model(dt, dt0)
    return np.kron(A, np.eye(3)), np.kron(b[:, None], np.eye(3)), np.kron(Q, np.eye(3))


def start(timeline, model):
    P = np.diag(np.append(np.zeros(6), np.repeat(model.initial_variances(), 3)))
    P[:6, :6] = timeline.P0
    return np.append(timeline.x0, np.zeros(len(P) - 6)), P


def smoothed_by_filterpy(timeline, model, fade=1.0):
    """States and covariances of filterpy's smoother, with P- multiplied by ``fade`` at each update."""
    x, P = start(timeline, model)
    kf = KalmanFilter(dim_x=len(x), dim_z=6)
    kf.x, kf.P, kf.H = x[:, None], P, np.eye(6, len(x))
    xs, Ps, Fs, Qs = [], [], [], []
    for dt, update in zip(timeline.dt_s, timeline.update, strict=True):
        F, _, Q = model_matrices(model, dt, timeline.dt0_s) if dt > 0 else (np.eye(len(x)), 0, np.zeros((len(x),) * 2))
        if update >= 0:
            Q = Q + (fade - 1.0) * (F @ kf.P @ F.T + Q)
        kf.predict(F=F, Q=Q)
        if update >= 0:
            kf.update(timeline.measurements.z[update][:, None], R=timeline.measurements.R[update])
        for values, value in zip((xs, Ps, Fs, Qs), (kf.x.copy(), kf.P.copy(), F, Q), strict=True):
            values.append(value)
    xs, Ps, _, _ = kf.rts_smoother(np.array(xs), np.array(Ps), Fs, Qs)
    at = np.flatnonzero(timeline.reference >= 0)
    return xs[at, :, 0], Ps[at]


def batch_solution(timeline, model):
    """Mean and covariance of the states of all steps, given all measurements."""
    x, P = start(timeline, model)
    n, s = len(timeline.dt_s), len(x)
    mean, joint = np.zeros((n, s)), np.zeros((n * s, n * s))
    block = [slice(k * s, (k + 1) * s) for k in range(n)]
    mean[0], joint[block[0], block[0]] = x, P
    for k in range(1, n):
        F, B, Q = model_matrices(model, timeline.dt_s[k], timeline.dt0_s)
        mean[k] = F @ mean[k - 1] + B @ timeline.accel_enu_mps2[timeline.sample[k]]
        joint[block[k], : k * s] = F @ joint[block[k - 1], : k * s]
        joint[: k * s, block[k]] = joint[block[k], : k * s].T
        joint[block[k], block[k]] = F @ joint[block[k - 1], block[k - 1]] @ F.T + Q
    seen = [(k, u, i) for k, u in enumerate(timeline.update) if u >= 0 for i in range(6)]
    seen = [(k, u, i) for k, u, i in seen if np.isfinite(timeline.measurements.z[u, i])]
    H = np.zeros((len(seen), n * s))
    H[np.arange(len(seen)), [k * s + i for k, _, i in seen]] = 1.0
    z = np.array([timeline.measurements.z[u, i] for _, u, i in seen])
    R = np.diag([timeline.measurements.R[u, i, i] for _, u, i in seen])
    gain = np.linalg.solve(H @ joint @ H.T + R, H @ joint).T
    states, covariance = mean.ravel() + gain @ (z - H @ mean.ravel()), joint - gain @ H @ joint
    return states.reshape(n, s), [covariance[b, b] for b in block]


@pytest.mark.parametrize("name", MODELS)
def test_it_equals_the_batch_solution_with_input_and_absent_rows(name):
    recording = noisy_recording(duration_s=4.0, imu_rate_hz=10, gnss_rate_hz=2)
    masked = recording.velocity.mps.copy()
    masked[3:6, 1], masked[5] = np.nan, np.nan
    stamps = np.array([0.55, 1.0, 1.74, 2.5, 3.33, 3.9])  # most of them split a sample
    recording = replace(
        recording,
        velocity=replace(recording.velocity, mps=masked),
        reference=Reference(stamps, "none", independent=True, enu_m=np.zeros((6, 3))),
    )
    attitude = level_attitude(recording, np.sin(np.arange(120.0)).reshape(40, 3))
    smoother = smoother_of(name)
    timeline = build_timeline(recording, attitude)
    states, covariances = batch_solution(timeline, smoother.kinematic_filter())

    estimate = smoother.estimate(recording, attitude, NoAdaptation())
    at = np.flatnonzero(timeline.reference >= 0)
    assert len(estimate.index) == len(stamps)
    np.testing.assert_allclose(estimate.position_m, states[at, :3], atol=1e-7)
    np.testing.assert_allclose(estimate.velocity_mps, states[at, 3:6], atol=1e-7)
    for k, covariance in zip(at, estimate.covariance, strict=True):
        np.testing.assert_allclose(covariance, covariances[k][:6, :6], rtol=1e-4, atol=1e-8)


def test_it_equals_the_filter_at_the_end_and_has_a_smaller_covariance_before():
    recording = noisy_recording(duration_s=6.0)
    attitude, smoother = level_attitude(recording), RauchTungStriebel("jerk")
    timeline = build_timeline(recording, attitude)
    filtered = FilterpyEngine().run(timeline, smoother.kinematic_filter(), Mtf())
    estimate = smoother.estimate(recording, attitude, Mtf())

    np.testing.assert_allclose(estimate.position_m[-1], filtered.position_m[-1], atol=1e-10)
    np.testing.assert_allclose(estimate.updates.R_diagonal, filtered.updates.R_diagonal, rtol=1e-9)
    np.testing.assert_allclose(estimate.updates.nis_used, filtered.updates.nis_used, rtol=1e-8)
    surer = np.linalg.eigvalsh(filtered.covariance - estimate.covariance)[:, 0]
    assert surer.min() > -1e-12
    assert estimate.covariance[100, 0, 0] < 0.7 * filtered.covariance[100, 0, 0]


def adapting(**methods):
    return type("Adapting", (NoAdaptation,), methods)()


def test_a_forward_pass_that_diverges_is_smoothed_up_to_there():
    recording = noisy_recording(duration_s=2.0)
    estimate = RauchTungStriebel().estimate(
        recording, level_attitude(recording), adapting(adapt=lambda self, y, HPHt, R, *_: -R)
    )

    assert estimate.failure == "the covariance is no longer positive definite at 0.40 s"
    assert recording.reference.t_s[estimate.index[-1]] == pytest.approx(0.39)


def test_it_supports_all_valid_models_and_adaptations_except_of_the_prior_or_the_gain():
    accepted = set(RauchTungStriebel().adaptations)
    choosers = {
        n for n in plugins.names("adaptation") if {"adapt_prior", "adapt_gain"} & set(dir(plugins.get("adaptation", n)))
    }
    assert accepted == set(plugins.names("adaptation")) - choosers
    assert {"none", "mtf", "oracle", "scalar_q"} <= accepted
    with pytest.raises(PluginError, match="Did you mean 'jerk'"):
        RauchTungStriebel("jrk")
    with pytest.raises(PluginError, match=r"filter=rts_fixes filter\.model=acceleration"):
        RauchTungStriebel("acceleration")
    with pytest.raises(PluginError, match="Did you mean 'constant_turn'"):
        SmoothedFixes("constant_tun")


def test_a_faded_covariance_is_a_larger_process_noise_of_the_step_before():
    """Fading P- by 2 is equivalent to adding P- to Q in the step before."""
    recording = noisy_recording(duration_s=2.0, imu_rate_hz=10, gnss_rate_hz=2)
    attitude, smoother = level_attitude(recording), RauchTungStriebel("baseline")
    xs, Ps = smoothed_by_filterpy(build_timeline(recording, attitude), smoother.kinematic_filter(), fade=2.0)

    estimate = smoother.estimate(recording, attitude, adapting(fade=lambda self, *update: 2.0))
    np.testing.assert_allclose(estimate.position_m, xs[:, :3], atol=1e-9)
    np.testing.assert_allclose(estimate.covariance, Ps, rtol=1e-6, atol=1e-12)


def fixes_of_a_circle(radius_m=40.0, speed_mps=8.0, gap_s=(20.0, 26.0), sigma_m=0.01):
    t_s = np.arange(0.0, 60.0)
    angle = speed_mps / radius_m * t_s
    circle_m = radius_m * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rows = (t_s < gap_s[0]) | (t_s > gap_s[1])
    fixes_m = circle_m[rows] + np.random.default_rng(2).normal(0, sigma_m, (rows.sum(), 3))
    position = Position(t_s[rows], fixes_m, np.tile(sigma_m**2 * np.eye(3), (rows.sum(), 1, 1)))
    return Recording("circle", None, Reference(t_s, "a circle", independent=True, enu_m=circle_m), position)


def smoothed_circle(**settings):
    recording = fixes_of_a_circle()
    estimate = SmoothedFixes(**settings).estimate(recording, no_attitude(recording.clock_s), NoAdaptation())
    return estimate, np.linalg.norm(estimate.position_m - recording.reference.enu_m, axis=1)


def test_without_a_turn_it_equals_the_smoother_over_constant_velocity():
    straight, _ = smoothed_circle()
    turning, _ = smoothed_circle(model="constant_turn", turn_walk_radps_per_sqrt_s=1e-8, initial_turn_radps=1e-7)

    np.testing.assert_allclose(turning.position_m, straight.position_m, atol=1e-6)
    np.testing.assert_allclose(turning.covariance, straight.covariance, rtol=1e-4, atol=1e-9)


def test_an_update_without_rows_neither_fades_nor_adapts():
    """`scalar_q` fades by a factor of hundreds after an outlier, but the rows of the next update are absent."""
    recording = noisy_recording(duration_s=6.0, imu_rate_hz=50)
    timeline = build_timeline(recording, level_attitude(recording))
    at = len(timeline.measurements.z) // 2
    z = timeline.measurements.z.copy()
    z[at] += 50.0
    z[at + 1 : at + 5] = np.nan
    absent = replace(timeline, measurements=replace(timeline.measurements, z=z))
    update = timeline.update.copy()
    update[(update > at) & (update < at + 5)] = -1
    none = replace(absent, update=update)
    scalar_q = plugins.create("adaptation", {"name": "scalar_q"})

    smoothed, expected = (RauchTungStriebel("jerk").smooth(of, scalar_q) for of in (absent, none))

    np.testing.assert_array_equal(smoothed.covariance, expected.covariance)
    np.testing.assert_array_equal(smoothed.position_m, expected.position_m)
