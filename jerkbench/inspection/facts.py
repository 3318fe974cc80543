"""What is known of a recording: facts and findings as text, an overview as a figure."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.yaw import YAW_COARSE, YAW_UNKNOWN, Track, is_coarse, select_headings
from jerkbench.inspection.doctor import diagnoses
from jerkbench.inspection.evidence import moving_speed_mps, without_nan_rows
from jerkbench.inspection.lags import MIN_CORRELATION, SHIFT_PARAMETERS, WORST_S, Lag, all_lags
from jerkbench.inspection.noise import (
    MIN_REST_S,
    RestNoise,
    Sigma,
    longest_rest,
    overstated_noise,
    rest_noise,
    stated_against_real_sigma,
    velocity_dependence,
)
from jerkbench.io.frames import felt_axis
from jerkbench.io.sanitiser import imu_gap_notes, repeated_samples
from jerkbench.recording import Heading, Imu, Position, Recording, Reference, Velocity
from jerkbench.report.plots.style import (
    DOTS_PER_INCH,
    MEASURED,
    OKABE_ITO,
    REFERENCE,
    SHADE,
    literal,
    say,
    style_axes,
)

Stream = Imu | Position | Velocity | Heading | Reference

_AXES = {"enu": ("east", "north", "up"), "body": ("forward", "left", "up"), "speed": ("along", "left", "up")}
"""The axes of a velocity in each of its frames."""

SHOWN_S = 0.02
"""A smaller lag needs no correction."""

_GAP = 2.5
"""A step of more than so many usual intervals is a gap."""


def facts_text(recording: Recording) -> str:
    """Return everything, one fact a line."""
    lines = [recording.name, *_times(recording), "", *_streams(recording), "", *_inertial(recording)]
    lines += ["", findings_text(recording), ""]
    return "\n".join([*lines, *(f"Note: {note}" for note in recording.notes)])


def _times(recording: Recording) -> Iterator[str]:
    utc = recording.start_utc
    start = utc.isoformat() if utc and utc.year >= 1980 else "unknown"  # times may be relative
    still = recording.static_start_s
    standstill = f"stands still for {still:.1f} s" if still else "no standstill at its start is known or given"
    yield f"start (UTC) {start}, {recording.duration_s:.2f} s; {standstill}"
    if recording.origin is not None:
        o = recording.origin
        yield f"origin {o.latitude_deg:.7f} deg, {o.longitude_deg:.7f} deg, {o.height_m:.2f} m"


def _streams(recording: Recording) -> Iterator[str]:
    for name in ("imu", "position", "velocity", "heading", "reference"):
        stream: Stream | None = getattr(recording, name)
        if stream is None or (name == "reference" and recording.reference.empty):
            yield f"{name:<10}none"
        else:
            rates = _rates(stream) if isinstance(stream, Velocity) else [_rate(stream.t_s)]
            yield f"{name:<10}{'; '.join(rates)}{_sigma(stream)}"


def _rates(velocity: Velocity) -> list[str]:
    """Rows and rate; where axes of a velocity were true at times of their own, of each of them."""
    measured = np.isfinite(velocity.mps)
    groups = [group for group in np.unique(measured, axis=0) if group.any()]
    if len(groups) < 2 or np.sum(groups, axis=0).max() > 1:
        return [_rate(velocity.t_s)]
    axes, rows = np.array(_AXES[velocity.frame]), [(measured == group).all(axis=1) for group in groups]
    rates = [_rate(velocity.t_s[own]).lstrip() for own in rows]
    return [f"{' and '.join(axes[group])} {rate}" for group, rate in zip(groups, rates, strict=True)]


def _rate(t_s: FloatArray) -> str:
    if len(t_s) < 2:
        return f"{len(t_s):>7} rows"
    steps = np.diff(t_s)
    usual = float(np.median(steps))
    gaps = steps[steps > _GAP * usual]
    gap_text = f"; {len(gaps)} gaps, the longest {gaps.max():.2f} s" if len(gaps) else "; no gaps"
    return f"{len(t_s):>7} rows, {1 / usual:.4g} Hz, {t_s[0]:.3f} to {t_s[-1]:.3f} s{gap_text}"


def _sigma(stream: object) -> str:
    """The stated standard deviations (median), axis by axis, where something was measured."""
    for values, covariance, unit in (("enu_m", "covariance_m2", "m"), ("mps", "covariance_m2ps2", "m/s")):
        if hasattr(stream, covariance) and np.isfinite(getattr(stream, values)).any(axis=0).all():
            variances = np.diagonal(getattr(stream, covariance), axis1=1, axis2=2)
            measured = np.where(np.isfinite(getattr(stream, values)), variances, np.nan)
            median = np.sqrt(np.nanmedian(measured, axis=0))
            return "; stated sigma (median) " + ", ".join(f"{value:.3g}" for value in median) + f" {unit}"
    return ""


def _inertial(recording: Recording) -> Iterator[str]:
    imu = recording.imu
    if imu is None:
        yield "no IMU: attitude, tilt and yaw do not apply; filters that take no acceleration run, from fix to fix"
        return
    force, felt = np.median(imu.accel_mps2, axis=0), felt_axis(imu.accel_mps2)
    size, turned = np.linalg.norm(force), "; a body in FLU feels it on +z: the axes need turning"
    gravity = f"gravity is felt on {felt}{'' if felt == '+z' else turned}"
    yield f"specific force (median) {np.array2string(force, precision=3)} m/s2, |f| {size:.3f}: {gravity}"
    if repeated := repeated_samples(imu):
        share = repeated / len(imu.t_s)
        yield f"{repeated} of {len(imu.t_s)} samples ({share:.1%}) repeat all values of the one before"
    rate = np.median(imu.gyro_radps, axis=0)
    yield f"angular rate (median) {np.array2string(np.degrees(rate), precision=3)} deg/s"


def findings_text(recording: Recording) -> str:
    """Return lags, the source of yaw, the velocity's dependence, real and stated sigmas, noise at rest, mistakes."""
    lags, rest = all_lags(recording), longest_rest(recording)
    speed_mps = float("nan") if recording.position is None else moving_speed_mps(recording.position)
    lines = [_lag_line(lag, speed_mps) for lag in lags]
    lines += [yaw_line(recording)] if recording.imu is not None else []
    for stream, correlation in velocity_dependence(recording):
        alike = f"fast changes correlate by {correlation:.2f} (0: noise of its own, 1: one is computed from the other)"
        lines.append(f"{stream} against the slope of the positions: {alike}")
    lines += [_sigma_line(sigma) for sigma in stated_against_real_sigma(recording, rest)]
    if recording.imu is not None:
        lines += _noise_lines(recording, rest_noise(recording, rest))
    checks = (*imu_gap_notes(recording.imu), *overstated_noise(recording, rest))
    lines += [f"to check: {remark}" for remark in checks]
    mistakes = diagnoses(recording, lags)
    lines += [f"mistake: {diagnosis}" for diagnosis in mistakes] or ["mistakes: none that is sure"]
    return "\n".join(lines)


def _lag_line(lag: Lag, speed_mps: float) -> str:
    pair = f"lag of {lag.stream} against {lag.against}"
    if np.isnan(lag.correlation):
        return f"{pair}: cannot be told, for too little of both overlaps in motion"
    if np.isfinite(lag.edge_s):
        best = f"of those that were tried {lag.edge_s:+.2f} s, at their edge, fits best"
        return f"{pair}: {best} (correlation {lag.correlation:.2f}): the true one may lie beyond it; check both clocks"
    if np.isnan(lag.best_s):
        return f"{pair}: cannot be told (correlation {lag.correlation:.2f})"
    correlations = f"correlation {lag.correlation:.3f}, without a shift {lag.at_none:.3f}"
    if np.isfinite(lag.lag_s):
        line = f"{pair}: {lag.lag_s:+.3f} s, give or take {lag.within_s:.2f} s ({correlations})"
    else:
        weak = "weak, and not sure" if lag.correlation < MIN_CORRELATION else "not well known"
        fitting = f"{lag.best_s:+.2f} s fits best, and lags within {lag.within_s:.2f} s fit alike"
        line = f"{pair}: {weak}; {fitting} ({correlations})"
    if abs(lag.best_s) < SHOWN_S:
        return line
    if lag.stream in ("imu", "position") and np.isfinite(speed_mps):  # what it does to a filter
        error_m = abs(lag.best_s) * speed_mps
        line += f"; at {speed_mps:.1f} m/s (median) it shifts places by {error_m:.2g} m along the track"
    return line + _remedy(lag)


def _remedy(lag: Lag) -> str:
    if not lag.sure and abs(lag.best_s) >= WORST_S:
        return "; not sure: the stamps are off, or the sensor turns before or after it goes, as in a hand"
    if not lag.sure or lag.correlation < MIN_CORRELATION:
        return ""
    well_known = np.isfinite(lag.lag_s) and abs(lag.lag_s) > lag.within_s
    return f"; to mend it add {-lag.best_s:+.2f} to {SHIFT_PARAMETERS[lag.stream]}" if well_known else ""


def _sigma_line(sigma: Sigma) -> str:
    real, stated = (", ".join(f"{value:.3g}" for value in values) for values in (sigma.real, sigma.stated))
    times = f"{sigma.ratio:.2f} times as large as stated ({sigma.rows} rows)"
    return f"{sigma.stream}, {sigma.basis}: {real} {sigma.unit}; stated {stated} {sigma.unit}: {times}"


def _noise_lines(recording: Recording, noise: RestNoise | None) -> Iterator[str]:
    stated = f"a rest of {recording.static_start_s:.1f} s" if recording.static_start_s else "no rest"
    advice = f"{stated} at the start is known; if there is one, give static_start_s (for a bag: rest_s)"
    if noise is None:
        yield f"imu noise: not measured; the IMU shows no rest of {MIN_REST_S:.0f} s, and {advice}"
        return
    begin_s, end_s, is_stated = noise.rest
    gyro = f"gyro {noise.angle_random_walk_deg_per_sqrt_h:.3g} deg/sqrt(h)"
    accel = f"accelerometer {noise.velocity_random_walk_mps_per_sqrt_h:.3g} m/s/sqrt(h)"
    yield f"imu noise over {end_s - begin_s:.0f} s of rest: {gyro}, {accel}; nearest grade: {noise.grade}"
    if not is_stated:
        yield f"the IMU shows that rest from {begin_s:.1f} to {end_s:.1f} s; {advice}"
    if np.isfinite(noise.gyro_instability_deg_per_h):
        accel = f"accelerometer {noise.accel_instability_mg:.3g} mg"
        yield f"imu instability: gyro {noise.gyro_instability_deg_per_h:.3g} deg/h, {accel}"


def yaw_line(recording: Recording) -> str:
    """Say what the attitude filters take yaw from by themselves, or that nothing shows it."""
    tilt = Tilt()
    selected = select_headings(recording, tilt.yaw_source, tilt.course_min_speed_mps, tilt.course_sigma_min_rad)
    if selected is None and recording.position is None:
        return "yaw: nothing shows it; there is no heading, no velocity over ground that is fast enough, and no fix"
    if selected is None:
        return f"yaw: {YAW_UNKNOWN}"
    if isinstance(selected, Track):
        chords = selected.chords
        line = f"yaw: from the track of the fixes, {len(chords.end_s)} courses, the first one known at"
        line += f" {chords.end_s[0]:.2f} s; sigma {np.median(chords.sigma_rad):.2g} rad (median)"
        return f"{line}. {YAW_COARSE.capitalize()}" if is_coarse(selected) else line
    if selected is recording.heading:
        return f"yaw: from {len(selected.t_s)} headings of source {selected.source}"
    return f"yaw: from the course of {len(selected.t_s)} velocities above {tilt.course_min_speed_mps:g} m/s"


# A picture of a recording: its path, its speed, the IMU's measurements, the receiver's sigmas.

MAX_POINTS = 4000
"""More points of a line do not show at this size."""


def overview_figure(recording: Recording) -> Figure:
    """Draw six panels: track, speed, specific force, angular rate, stated sigmas, Allan deviation at rest."""
    figure = Figure(figsize=(10.0, 9.0), dpi=DOTS_PER_INCH, layout="constrained")
    track, speed, force, rate, sigma, allan = figure.subplots(3, 2).ravel()
    _draw_track(track, recording)
    _draw_speed(speed, recording)
    imu, position, noise = recording.imu, recording.position, rest_noise(recording, longest_rest(recording))
    forces, rates = (None, None) if imu is None else (imu.accel_mps2, np.degrees(imu.gyro_radps))
    for axes, values, label in ((force, forces, "Specific force [m/s²]"), (rate, rates, "Angular rate [deg/s]")):
        axes.set_ylabel(label)
        _draw_axes(axes, imu, values, _AXES["body"], 0.5, "The recording has no IMU.")
    sigmas = None
    if position is not None:
        variances = np.diagonal(position.covariance_m2, axis1=1, axis2=2)
        sigmas = np.sqrt(np.where(np.isfinite(position.enu_m), variances, np.nan))
    sigma.set_ylabel("Stated sigma of position [m]")
    _draw_axes(sigma, position, sigmas, _AXES["enu"], 0.9, "The recording has no position.")
    if position is not None:
        sigma.set_ylim(bottom=0.0)
    allan.set(xlabel="Averaging time [s]", ylabel="Allan deviation at rest")
    if noise is None:
        say(allan, "No rest of 5 s is known or found.")
    else:
        deviations = {"gyro [rad/s]": noise.gyro_radps, "accelerometer [m/s²]": noise.accel_mps2}
        for colour, (name, values) in zip(OKABE_ITO, deviations.items(), strict=False):
            allan.loglog(noise.tau_s, values.max(axis=1), color=colour, label=name)
    for axes in (speed, force, rate, sigma):
        axes.set_xlabel("Time [s]")
        for begin, end in recording.outages_s:
            axes.axvspan(begin, end, color=SHADE, alpha=0.28, linewidth=0)
    for axes in figure.axes:
        style_axes(axes)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(frameon=False, fontsize="small")
    figure.suptitle(literal(recording.name))
    return figure


def _thin(t_s: FloatArray, *values: FloatArray) -> tuple[FloatArray, ...]:
    every = max(1, len(t_s) // MAX_POINTS)
    return t_s[::every], *(value[::every] for value in values)


def _draw_track(axes: Axes, recording: Recording) -> None:
    axes.set(xlabel="East [m]", ylabel="North [m]")
    if recording.position is None and recording.reference.enu_m is None:
        say(axes, "The recording has no position.")
        return
    if recording.position is not None:
        axes.plot(*recording.position.enu_m[:, :2].T, ".", color=MEASURED, markersize=4.0, label="measured")
    if recording.reference.enu_m is not None:
        axes.plot(*recording.reference.enu_m[:, :2].T, color=REFERENCE, linewidth=0.8, label="reference")
    axes.set_aspect("equal", adjustable="datalim")


def _draw_speed(axes: Axes, recording: Recording) -> None:
    axes.set_ylabel("Speed [m/s]")
    truth, velocity = recording.reference.velocity_mps, recording.velocity
    if velocity is None and truth is None:
        say(axes, "The recording has no velocity.")
        return
    if velocity is not None:  # over ground in ENU, along the first axis of a body or a wheel
        t_s, mps = without_nan_rows(velocity.t_s, velocity.mps[:, : 2 if velocity.frame == "enu" else 1])
        shown = _thin(t_s, np.linalg.norm(mps, axis=1))
        axes.plot(*shown, color=OKABE_ITO[0], linewidth=0.9, label="measured")
    if truth is not None:
        shown = _thin(recording.reference.t_s, np.linalg.norm(truth[:, :2], axis=1))
        axes.plot(*shown, color=REFERENCE, linewidth=0.7, linestyle="--", label="reference")
    axes.set_ylim(bottom=0.0)


def _draw_axes(
    axes: Axes,
    stream: Imu | Position | None,
    values: FloatArray | None,
    names: tuple[str, ...],
    width: float,
    none: str,
) -> None:
    """Draw the three columns of values (n, 3) over the times of a stream; ``none`` says that there are none."""
    if stream is None or values is None:
        say(axes, none)
        return
    t_s, shown = _thin(stream.t_s, values)
    for axis, name in enumerate(names):
        axes.plot(t_s, shown[:, axis], color=OKABE_ITO[axis], linewidth=width, label=name)
