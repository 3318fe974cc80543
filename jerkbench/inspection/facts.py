"""Text with facts and findings about a recording, and a figure with an overview."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jerkbench.arrays import FloatArray
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.yaw import YAW_COARSE, YAW_UNKNOWN, Track, is_coarse, select_headings
from jerkbench.inspection.diagnostics import diagnoses
from jerkbench.inspection.evidence import moving_speed_mps, without_nan_rows
from jerkbench.inspection.lags import MAX_UNCERTAINTY_S, MIN_CORRELATION, SHIFT_PARAMETERS, Lag, all_lags
from jerkbench.inspection.noise import (
    MIN_REST_S,
    RestNoise,
    Sigma,
    longest_rest,
    overstated_noise,
    rest_noise,
    stated_against_real_sigma,
)
from jerkbench.io.conversions import felt_axis
from jerkbench.io.sanitiser import imu_gap_notes, repeated_samples
from jerkbench.recording import THE_FIXES, Heading, Imu, Position, Recording, Reference, Velocity
from jerkbench.report.plots.style import (
    DOTS_PER_INCH,
    MEASURED,
    OKABE_ITO,
    REFERENCE,
    SHADE,
    literal,
    style_axes,
)

Stream = Imu | Position | Velocity | Heading | Reference

_AXES = {"enu": ("east", "north", "up"), "body": ("forward", "left", "up"), "speed": ("along", "left", "up")}
"""The axes of a velocity in each of its frames."""

MIN_CORRECTED_LAG_S = 0.02
"""Minimum lag [s] that needs a correction."""

_GAP = 2.5
"""A step between stamps is a gap if the step is longer than this factor times the median step."""


def facts_text(recording: Recording) -> str:
    """Return a text with all facts and findings about a recording, one per line."""
    lines = [recording.name, *_times(recording), "", *_streams(recording), "", *_inertial(recording)]
    lines += ["", findings_text(recording), ""]
    return "\n".join([*lines, *(f"Note: {note}" for note in recording.notes)])


def _times(recording: Recording) -> Iterator[str]:
    utc = recording.start_utc
    start = utc.isoformat() if utc and utc.year >= 1980 else "unknown"  # a date before 1980 means relative times
    still = recording.static_start_s
    standstill = f"stationary for {still:.1f} s at the start" if still else "no stationary time at the start is known"
    yield f"start (UTC) {start}, {recording.duration_s:.2f} s; {standstill}"
    if recording.origin is not None:
        o = recording.origin
        yield f"origin {o.latitude_deg:.7f} deg, {o.longitude_deg:.7f} deg, {o.height_m:.2f} m"


def _streams(recording: Recording) -> Iterator[str]:
    absent = recording.reference.empty or recording.reference.source == THE_FIXES
    for name in ("imu", "position", "velocity", "heading", "reference"):
        stream: Stream | None = getattr(recording, name)
        if stream is None or (name == "reference" and absent):
            yield f"{name:<10}none"
        else:
            rates = _rates(stream) if isinstance(stream, Velocity) else [_rate(stream.t_s)]
            yield f"{name:<10}{'; '.join(rates)}{_sigma(stream)}"


def _rates(velocity: Velocity) -> list[str]:
    """Return the number of rows and the rate as text, for each group of axes with the same stamps."""
    measured = np.isfinite(velocity.mps)
    groups = [group for group in np.unique(measured, axis=0) if group.any()]
    if len(groups) < 2 or np.sum(groups, axis=0).max() > 1:
        return [_rate(velocity.t_s)]
    axes, rows_of_groups = np.array(_AXES[velocity.frame]), [(measured == group).all(axis=1) for group in groups]
    rates = [_rate(velocity.t_s[group_rows]).lstrip() for group_rows in rows_of_groups]
    return [f"{' and '.join(axes[group])} {rate}" for group, rate in zip(groups, rates, strict=True)]


def _rate(t_s: FloatArray) -> str:
    if len(t_s) < 2:
        return f"{len(t_s):>7} rows"
    steps = np.diff(t_s)
    median_s = float(np.median(steps))
    gaps = steps[steps > _GAP * median_s]
    gap_text = f"; {len(gaps)} gaps, the longest {gaps.max():.2f} s" if len(gaps) else "; no gaps"
    return f"{len(t_s):>7} rows, {1 / median_s:.4g} Hz, {t_s[0]:.3f} to {t_s[-1]:.3f} s{gap_text}"


def _sigma(stream: object) -> str:
    """Return the medians of the stated standard deviations as text, over the rows in which the axis was measured."""
    if not isinstance(stream, Position | Velocity) or not np.isfinite(stream.values).any(axis=0).all():
        return ""
    variances = np.where(np.isfinite(stream.values), np.diagonal(stream.reported, axis1=1, axis2=2), np.nan)
    median, unit = np.sqrt(np.nanmedian(variances, axis=0)), "m" if isinstance(stream, Position) else "m/s"
    return "; stated sigma (median) " + ", ".join(f"{value:.3g}" for value in median) + f" {unit}"


def _inertial(recording: Recording) -> Iterator[str]:
    imu = recording.imu
    if imu is None:
        yield "no IMU: attitude, tilt and yaw do not apply; only filters without acceleration run, at the fixes"
        return
    force, felt = np.median(imu.accel_mps2, axis=0), felt_axis(imu.accel_mps2)
    size, advice = np.linalg.norm(force), ", but a body in FLU has it on +z: rotate the axes"
    gravity = f"gravity is on {felt}{'' if felt == '+z' else advice}"
    yield f"specific force (median) {np.array2string(force, precision=3)} m/s2, |f| {size:.3f}: {gravity}"
    if repeated := repeated_samples(imu):
        share = repeated / len(imu.t_s)
        yield f"{repeated} of {len(imu.t_s)} samples ({share:.1%}) repeat all values of the previous sample"
    rate = np.median(imu.gyro_radps, axis=0)
    yield f"angular rate (median) {np.array2string(np.degrees(rate), precision=3)} deg/s"


def findings_text(recording: Recording) -> str:
    """Return a text with the lags, the source of the yaw, measured and stated sigmas, noise at rest, and mistakes."""
    lags, rest = all_lags(recording), longest_rest(recording)
    speed_mps = float("nan") if recording.position is None else moving_speed_mps(recording.position)
    lines = [_lag_line(lag, speed_mps) for lag in lags]
    lines += [yaw_line(recording)] if recording.imu is not None else []
    lines += [_sigma_line(sigma) for sigma in stated_against_real_sigma(recording, rest)]
    if recording.imu is not None:
        lines += _noise_lines(recording, rest_noise(recording, rest))
    checks = (*imu_gap_notes(recording.imu), *overstated_noise(recording, rest))
    lines += [f"to check: {note}" for note in checks]
    lines += [f"mistake: {diagnosis}" for diagnosis in diagnoses(recording, lags)] or ["mistakes: none found"]
    return "\n".join(lines)


def _lag_line(lag: Lag, speed_mps: float) -> str:
    pair = f"lag of {lag.stream} against {lag.against}"
    if np.isnan(lag.correlation):
        return f"{pair}: unknown, because the two streams overlap too little in motion"
    if np.isfinite(lag.edge_s):
        best = f"{lag.edge_s:+.2f} s, the limit of the search (correlation {lag.correlation:.2f})"
        return f"{pair}: {best}; the true lag may be larger: check both clocks"
    if np.isnan(lag.best_s):
        return f"{pair}: unknown (correlation {lag.correlation:.2f})"
    correlations = f"correlation {lag.correlation:.3f}, without a shift {lag.at_none:.3f}"
    if np.isfinite(lag.lag_s):
        line = f"{pair}: {lag.lag_s:+.3f} s +- {lag.within_s:.2f} s ({correlations})"
    else:
        weak = "not significant" if lag.correlation < MIN_CORRELATION else "uncertain"
        line = f"{pair}: {weak}; best {lag.best_s:+.2f} s +- {lag.within_s:.2f} s ({correlations})"
    if abs(lag.best_s) < MIN_CORRECTED_LAG_S:
        return line
    if lag.stream in ("imu", "position") and np.isfinite(speed_mps):  # effect of the lag on a filter
        error_m = abs(lag.best_s) * speed_mps
        line += f"; at the median speed of {speed_mps:.1f} m/s it shifts positions by {error_m:.2g} m along the track"
    return line + _remedy(lag)


def _remedy(lag: Lag) -> str:
    if not lag.sure and abs(lag.best_s) >= MAX_UNCERTAINTY_S:
        return "; not certain: either the stamps are wrong, or the sensor turns before or after it moves, as in a hand"
    if not lag.sure or lag.correlation < MIN_CORRELATION:
        return ""
    well_known = np.isfinite(lag.lag_s) and abs(lag.lag_s) > lag.within_s
    return f"; to correct it, add {-lag.best_s:+.2f} to {SHIFT_PARAMETERS[lag.stream]}" if well_known else ""


def _sigma_line(sigma: Sigma) -> str:
    real, stated = (", ".join(f"{value:.3g}" for value in values) for values in (sigma.real, sigma.stated))
    times = f"{sigma.ratio:.2f} times the stated value ({sigma.rows} rows)"
    return f"{sigma.stream}, {sigma.basis}: {real} {sigma.unit}; stated {stated} {sigma.unit}: {times}"


def _noise_lines(recording: Recording, noise: RestNoise | None) -> Iterator[str]:
    stated = "no rest at the start is stated; if there is one"
    if recording.static_start_s:
        stated = f"the stated rest at the start is {recording.static_start_s:.1f} s; if it is longer"
    advice = f"{stated}, set static_start_s (for a bag: rest_s)"
    if noise is None:
        yield f"imu noise: not measured; the IMU has no rest of {MIN_REST_S:.0f} s, and {advice}"
        return
    begin_s, end_s, is_stated = noise.rest
    gyro = f"gyro {noise.angle_random_walk_deg_per_sqrt_h:.3g} deg/sqrt(h)"
    accel = f"accelerometer {noise.velocity_random_walk_mps_per_sqrt_h:.3g} m/s/sqrt(h)"
    yield f"imu noise over {end_s - begin_s:.0f} s of rest: {gyro}, {accel}; nearest grade: {noise.grade}"
    if not is_stated:
        yield f"this rest, from {begin_s:.1f} to {end_s:.1f} s, was found in the IMU's samples; {advice}"
    if np.isfinite(noise.gyro_instability_deg_per_h):
        accel = f"accelerometer {noise.accel_instability_mg:.3g} mg"
        yield f"imu instability: gyro {noise.gyro_instability_deg_per_h:.3g} deg/h, {accel}"


def yaw_line(recording: Recording) -> str:
    """Return a text with the source from which the attitude filters compute the yaw by default."""
    tilt = Tilt()
    selected = select_headings(recording, tilt.yaw_source, tilt.course_min_speed_mps, tilt.course_sigma_min_rad)
    if selected is None and recording.position is None:
        return "yaw: unknown; there is no heading, no sufficiently fast velocity over ground, and no fix"
    if selected is None:
        return f"yaw: {YAW_UNKNOWN}"
    if isinstance(selected, Track):
        chords = selected.chords
        line = f"yaw: from the track of the fixes, {len(chords.end_s)} courses, the first at"
        line += f" {chords.end_s[0]:.2f} s; sigma {np.median(chords.sigma_rad):.2g} rad (median)"
        return f"{line}. {YAW_COARSE.capitalize()}" if is_coarse(selected) else line
    if selected is recording.heading:
        return f"yaw: from {len(selected.t_s)} headings of source {selected.source}"
    return f"yaw: from the course of {len(selected.t_s)} velocities above {tilt.course_min_speed_mps:g} m/s"


# Overview figure of a recording: track, speed, IMU measurements, stated sigmas of the receiver.

MAX_POINTS = 4000
"""Maximum number of points of a line; more points are not visible at the size of the figure."""

_TRACK, _SPEED, _SIGMA = "North [m]", "Speed [m/s]", "Stated sigma of position [m]"
"""Labels of the panels that are not simple plots over time."""

_Line = tuple[FloatArray, FloatArray, dict[str, Any]]
"""The coordinates of the points of a line, and its style for matplotlib."""


def overview_figure(recording: Recording, reference: str = "reference") -> Figure:
    """Draw a figure with a panel for each quantity that the recording has. Legends call the reference ``reference``."""
    panels = {label: lines for label, lines in _panels(recording, reference).items() if lines}
    rows = (len(panels) + 1) // 2
    figure = Figure(figsize=(10.0, 3.0 * max(rows, 1)), dpi=DOTS_PER_INCH, layout="constrained")
    for k, (label, lines) in enumerate(panels.items()):
        axes = figure.add_subplot(rows, 2, k + 1)
        axes.set(ylabel=label, xlabel="East [m]" if label == _TRACK else "Time [s]")
        for x, y, style in lines:
            every = 1 if "marker" in style else max(1, len(x) // MAX_POINTS)
            axes.plot(x[::every], y[::every], **style)
        style_axes(axes)
        axes.legend(frameon=False, fontsize="small")
        if label == _TRACK:
            axes.set_aspect("equal", adjustable="datalim")
        else:
            for begin, end in recording.outages_s:
                axes.axvspan(begin, end, color=SHADE, alpha=0.28, linewidth=0)
        if label in (_SPEED, _SIGMA):
            axes.set_ylim(bottom=0.0)
    figure.suptitle(literal(recording.name))
    return figure


def _panels(recording: Recording, name: str) -> dict[str, list[_Line]]:
    """Return the lines of each panel, by the label of its vertical axis."""
    imu, position = recording.imu, recording.position
    track, speed = _lines_of_track(recording, name)
    panels = {_TRACK: track, _SPEED: speed}
    if imu is not None:
        panels["Specific force [m/s²]"] = _lines_of_axes(imu.t_s, imu.accel_mps2, _AXES["body"], 0.5)
        panels["Angular rate [deg/s]"] = _lines_of_axes(imu.t_s, np.degrees(imu.gyro_radps), _AXES["body"], 0.5)
    if position is not None:
        variances = np.diagonal(position.covariance_m2, axis1=1, axis2=2)
        values = np.sqrt(np.where(np.isfinite(position.enu_m), variances, np.nan))
        panels[_SIGMA] = _lines_of_axes(position.t_s, values, _AXES["enu"], 0.9)
    return panels


def _lines_of_axes(t_s: FloatArray, values: FloatArray, names: tuple[str, ...], width: float) -> list[_Line]:
    """Return a line for each column of ``values`` (n, k)."""
    return [
        (t_s, column, {"color": color, "linewidth": width, "label": name})
        for column, color, name in zip(values.T, OKABE_ITO, names, strict=False)
    ]


def _lines_of_track(recording: Recording, name: str) -> tuple[list[_Line], list[_Line]]:
    """Return the lines of the horizontal positions and of the speeds, for the measurements and for the reference."""
    position, velocity, reference = recording.position, recording.velocity, recording.reference
    track, speed = list[_Line](), list[_Line]()
    if position is not None:
        style = {"color": MEASURED, "linestyle": "none", "marker": ".", "markersize": 4.0, "label": "measured"}
        track.append((*position.enu_m[:, :2].T, style))
    if reference.enu_m is not None:
        track.append((*reference.enu_m[:, :2].T, {"color": REFERENCE, "linewidth": 0.8, "label": name}))
    if velocity is not None:  # speed over ground in ENU, or forward speed in other frames
        t_s, mps = without_nan_rows(velocity.t_s, velocity.mps[:, : 2 if velocity.frame == "enu" else 1])
        style = {"color": OKABE_ITO[0], "linewidth": 0.9, "label": "measured"}
        speed.append((t_s, np.linalg.norm(mps, axis=1), style))
    if reference.velocity_mps is not None:
        style = {"color": REFERENCE, "linewidth": 0.7, "linestyle": "--", "label": name}
        speed.append((reference.t_s, np.linalg.norm(reference.velocity_mps[:, :2], axis=1), style))
    return track, speed
