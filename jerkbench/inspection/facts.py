"""The facts of a recording: its streams, their rates and gaps, gravity, the covariances, the notes."""

from collections.abc import Iterator

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.remarks import findings_text
from jerkbench.io.frames import felt_axis
from jerkbench.io.sanitiser import repeated_samples
from jerkbench.recording import Heading, Imu, Position, Recording, Reference, Velocity

Stream = Imu | Position | Velocity | Heading | Reference

AXES = {"enu": ("east", "north", "up"), "body": ("forward", "left", "up"), "speed": ("along", "left", "up")}
"""The axes of a velocity in each of its frames."""

GAP = 2.5
"""A step of more than so many usual intervals is a gap."""


def facts_text(recording: Recording) -> str:
    """Return everything, one fact a line."""
    lines = [recording.name, *_times(recording), "", *_streams(recording), "", *_inertial(recording)]
    lines += ["", findings_text(recording), ""]
    return "\n".join([*lines, *(f"Note: {note}" for note in recording.notes)])


def _times(recording: Recording) -> Iterator[str]:
    start = recording.start_utc.isoformat() if recording.start_utc else "unknown"
    still = recording.static_start_s
    standstill = f"stands still for {still:.1f} s" if still else "no standstill at its start is known or given"
    yield f"start (UTC) {start}, {recording.duration_s:.2f} s; {standstill}"
    if recording.origin is not None:
        o = recording.origin
        yield f"origin {o.latitude_deg:.7f} deg, {o.longitude_deg:.7f} deg, {o.height_m:.2f} m"


def _streams(recording: Recording) -> Iterator[str]:
    streams: dict[str, Stream | None] = {
        "imu": recording.imu,
        "position": recording.position,
        "velocity": recording.velocity,
        "heading": recording.heading,
        "reference": None if recording.reference.empty else recording.reference,
    }
    for name, stream in streams.items():
        yield f"{name:<10}" + ("none" if stream is None else _rates(stream) + _sigma(stream))


def _rates(stream: Stream) -> str:
    return _velocity_rates(stream) if isinstance(stream, Velocity) else _rate(stream.t_s)


def _velocity_rates(velocity: Velocity) -> str:
    """Rows and rate; where axes were true at times of their own, of each of them."""
    measured = np.isfinite(velocity.mps)
    groups = [group for group in np.unique(measured, axis=0) if group.any()]
    if len(groups) < 2 or np.sum(groups, axis=0).max() > 1:
        return _rate(velocity.t_s)
    axes = np.array(AXES[velocity.frame])
    times_s = [velocity.t_s[(measured == group).all(axis=1)] for group in groups]
    rates = [_rate(t_s).lstrip() for t_s in times_s]
    return "; ".join(f"{' and '.join(axes[group])} {rate}" for group, rate in zip(groups, rates, strict=True))


def _rate(t_s: FloatArray) -> str:
    if len(t_s) < 2:
        return f"{len(t_s):>7} rows"
    steps = np.diff(t_s)
    usual = float(np.median(steps))
    gaps = steps[steps > GAP * usual]
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
    force = np.median(imu.accel_mps2, axis=0)
    size = np.linalg.norm(force)
    yield f"specific force (median) {np.array2string(force, precision=3)} m/s2, |f| {size:.3f}: {_up(force)}"
    if repeated := repeated_samples(imu):
        share = repeated / len(imu.t_s)
        yield f"{repeated} of {len(imu.t_s)} samples ({share:.1%}) repeat all values of the one before"
    rate = np.median(imu.gyro_radps, axis=0)
    yield f"angular rate (median) {np.array2string(np.degrees(rate), precision=3)} deg/s"


def _up(force: FloatArray) -> str:
    felt = felt_axis(force[None])
    up = f"gravity is felt on {felt}"
    return up if felt == "+z" else f"{up}; a body in FLU feels it on +z: the axes need turning"
