"""The findings of the inspection, in lines that a person reads."""

from collections.abc import Iterator

import numpy as np

from jerkbench.inspection.allan import SHORTEST_REST_S, RestNoise, rest_noise
from jerkbench.inspection.dependence import Dependence, velocity_dependence
from jerkbench.inspection.diagnosis.clocks import PARAMETERS, clock_offsets, late_imu
from jerkbench.inspection.diagnosis.doctor import first_diagnoses
from jerkbench.inspection.lags import Lag, estimated_lags
from jerkbench.inspection.peaks import LEAST_CORRELATION
from jerkbench.inspection.sigmas import Sigma, stated_against_real_sigma
from jerkbench.inspection.yaw import yaw_line
from jerkbench.recording import Recording


def findings_text(recording: Recording) -> str:
    """Return lags, the source of yaw, the velocity's dependence, real and stated sigmas, noise at rest, mistakes."""
    noise = rest_noise(recording)
    late = late_imu(recording)
    lines = [_lag_line(lag) for lag in (*estimated_lags(recording), *([late] if late else []))]
    lines += [yaw_line(recording)] if recording.imu is not None else []
    lines += [_dependence_line(dependence) for dependence in velocity_dependence(recording)]
    lines += [_sigma_line(sigma) for sigma in stated_against_real_sigma(recording)]
    if recording.imu is not None:
        lines += _noise_lines(noise) if noise else [_no_rest_line(recording)]
    mistakes = [*first_diagnoses(recording), *clock_offsets(recording, late)]
    lines += [f"mistake: {diagnosis}" for diagnosis in mistakes] or ["mistakes: none that is sure"]
    return "\n".join(lines)


def _lag_line(lag: Lag) -> str:
    pair = f"lag of {lag.stream} against {lag.against}"
    if np.isnan(lag.correlation):
        return f"{pair}: cannot be told, for too little of both overlaps in motion"
    if np.isfinite(lag.edge_s):
        return (
            f"{pair}: of those that were tried {lag.edge_s:+.2f} s, at their edge, fits best (correlation"
            f" {lag.correlation:.2f}): the true one may lie beyond it; check both clocks"
        )
    if np.isnan(lag.lag_s):
        if not lag.correlation >= LEAST_CORRELATION:
            return f"{pair}: cannot be told (correlation {lag.correlation:.2f})"
        return (
            f"{pair}: not well known; {lag.best_s:+.2f} s fits best, and lags within {lag.within_s:.2f} s fit alike"
            f" (correlation {lag.correlation:.2f}); to try it{_remedy(lag.stream, lag.best_s)}"
        )
    remedy = f"; to mend it{_remedy(lag.stream, lag.lag_s)}" if abs(lag.lag_s) > lag.within_s else ""
    return f"{pair}: {lag.lag_s:+.3f} s, give or take {lag.within_s:.2f} s (correlation {lag.correlation:.3f}){remedy}"


def _remedy(stream: str, lag_s: float) -> str:
    return f" add {-lag_s:+.2f} to {PARAMETERS[stream]}"


def _dependence_line(dependence: Dependence) -> str:
    return (
        f"{dependence.stream} against the slope of the positions: fast changes correlate by"
        f" {dependence.correlation:.2f} (0: noise of its own, 1: one is computed from the other)"
    )


def _sigma_line(sigma: Sigma) -> str:
    real, stated = (", ".join(f"{value:.3g}" for value in values) for values in (sigma.real, sigma.stated))
    return (
        f"{sigma.stream}, {sigma.basis}: {real} {sigma.unit}; stated {stated} {sigma.unit}: {sigma.ratio:.2f} times as"
        f" large as stated ({sigma.rows} rows)"
    )


def _no_rest_line(recording: Recording) -> str:
    known = f"a rest of {recording.static_start_s:.1f} s" if recording.static_start_s else "no rest"
    return (
        f"imu noise: not read; {known} at the start is known, and {SHORTEST_REST_S:.0f} s are needed: if there is such"
        " a rest, give static_start_s (rest_s of a bag)"
    )


def _noise_lines(noise: RestNoise) -> Iterator[str]:
    yield (
        f"imu noise over {noise.duration_s:.0f} s of rest: gyro {noise.angle_random_walk_deg_per_sqrt_h:.3g}"
        f" deg/sqrt(h), accelerometer {noise.velocity_random_walk_mps_per_sqrt_h:.3g} m/s/sqrt(h); nearest grade:"
        f" {noise.grade}"
    )
    if np.isfinite(noise.gyro_instability_deg_per_h):
        yield (
            f"imu instability: gyro {noise.gyro_instability_deg_per_h:.3g} deg/h, accelerometer"
            f" {noise.accel_instability_mg:.3g} mg"
        )
