"""Units and frames by the motion: gyro against track, fixes against velocity, forces against track."""

from typing import NamedTuple

import numpy as np

from jerkbench.inspection.diagnosis.gyro import DEG_PER_RAD, WITHIN, Turning, turning_gravity, turning_track
from jerkbench.inspection.diagnosis.mounting import plane_fit
from jerkbench.inspection.diagnosis.plane import IDENTITY, PLANE, axes_text
from jerkbench.inspection.diagnosis.relation import SURE, slope
from jerkbench.inspection.diagnosis.windows import window_means
from jerkbench.inspection.guess.guess import Guess
from jerkbench.recording import Recording

LEAST_COSINE = 0.9
LEAST_GAIN = 0.2
"""A frame of velocities fits the fixes at least so well, and by so much better than the other one."""

WINDOW_S = 1.0
SCALES = {"m/s": 1.0, "km/h": 3.6, "knots": 1.94384}
"""What a velocity in each unit is multiplied with."""


def gyro_unit(recording: Recording, named: str) -> Guess:
    """Return the unit of a gyro that was read as if it were in rad/s, by the track and by gravity."""
    turnings = (turning_track(recording), turning_gravity(recording.imu) if recording.imu is not None else None)
    sure = [turning for turning in turnings if turning is not None and abs(turning.strength) >= SURE]
    for turning in sure:
        for unit, factor in (("rad/s", 1.0), ("deg/s", 1 / DEG_PER_RAD)):
            if 1 / WITHIN < abs(turning.factor) / factor < WITHIN:
                return Guess("gyro_unit", unit, "measured", _turning_text(turning))
    if named:
        return Guess("gyro_unit", named, "named", "the columns say so; too few turns to see it")
    return Guess("gyro_unit", "rad/s", "unsure", "too few turns to see it, and the columns do not say it")


def turns_with_gyro(recording: Recording) -> tuple[bool | None, str]:
    """Return whether the track turns as the gyro does, None where that is not sure, and what was measured."""
    turning = turning_track(recording)
    if turning is None or abs(turning.strength) < SURE:
        return None, "too few turns to compare the track with the gyro"
    return turning.factor > 0, _turning_text(turning)


def forward(recording: Recording, body: tuple[str, ...], upright: Guess) -> Guess:
    """Return what the body's axes are on the sensor, by the track's acceleration, forward and left.

    Args:
        recording: read with ``body``.
        body: the axes by which it was read, whose z axis is up.
        upright: the guess of that.
    """
    fit = plane_fit(recording)
    if upright.grade != "measured":
        return upright
    if fit is None or not fit.sure or np.linalg.det(np.array(PLANE[fit.way])) < 0:
        return Guess("imu_axes", body, "unsure", f"{upright.why}; which way is forward cannot be told from the track")
    turned = tuple(axis.replace("--", "") for axis in axes_text(fit.way, (body[0], body[1])))
    why = f"{upright.why}; the track's acceleration fits the axes {'as they are' if fit.way == IDENTITY else fit.way}"
    return Guess("imu_axes", (*turned, body[2]), "measured", f"{why} (correlation {fit.correlation:.2f})")


class Agreement(NamedTuple):
    """How far velocities in one frame agree with the fixes.

    Attributes:
        cosine: of both series.
        factor: how many times as fast as the velocities the fixes move.
    """

    cosine: float
    factor: float


def velocity_frame(recording: Recording, named: str) -> tuple[Guess, Agreement | None]:
    """Return the frame of velocities that were read as ENU, by the fixes' way from second to second."""
    agreements = _agreements(recording)
    best = max(agreements, key=lambda frame: agreements[frame].cosine, default="")
    if not best or _unclear(agreements):
        grade, why = ("named", "the columns say so") if named else ("unsure", "the columns do not say it")
        return Guess("velocity_frame", named or "enu", grade, f"{why}; the fixes do not show it"), None  # type: ignore[arg-type]
    cosines = ", ".join(f"{frame} {agreement.cosine:.3f}" for frame, agreement in agreements.items())
    return Guess("velocity_frame", best, "measured", f"cosine with the fixes' way: {cosines}"), agreements[best]


def speed_unit(agreement: Agreement) -> str:
    """Return the unit of velocities, or nothing where no unit makes them agree with the fixes."""
    fitting = [unit for unit, scale in SCALES.items() if abs(agreement.factor * scale - 1.0) < 0.2]
    return fitting[0] if fitting else ""


def _unclear(agreements: dict[str, Agreement]) -> bool:
    cosines = sorted(agreement.cosine for agreement in agreements.values())
    return cosines[-1] < LEAST_COSINE or cosines[-1] - cosines[0] < LEAST_GAIN


def _agreements(recording: Recording) -> dict[str, Agreement]:
    position, velocity = recording.position, recording.velocity
    if position is None or velocity is None:
        return {}
    known = np.isfinite(position.enu_m).all(axis=1), np.isfinite(velocity.mps).all(axis=1)
    fix_s, places = position.t_s[known[0]], position.enu_m[known[0]]
    t_s, mps = velocity.t_s[known[1]], velocity.mps[known[1]]
    edges_s = np.arange(max(fix_s[0], t_s[0]), min(fix_s[-1], t_s[-1]), WINDOW_S)
    if len(edges_s) < 10:
        return {}
    at_edges = np.column_stack([np.interp(edges_s, fix_s, column) for column in places.T])
    way, means = np.diff(at_edges, axis=0) / WINDOW_S, window_means(t_s, mps, edges_s)
    frames = {"enu": means, "ned": means[:, [1, 0, 2]] * [1.0, 1.0, -1.0]}
    size = float(np.sqrt(np.sum(way**2) * np.sum(means**2)))
    return {
        frame: Agreement(float(np.sum(way * values)) / size if size else 0.0, slope(way, values))
        for frame, values in frames.items()
    }


def _turning_text(turning: Turning) -> str:
    return (
        f"{turning.basis} turns {turning.factor:.3g} times as fast as the gyro's numbers (correlation"
        f" {turning.correlation:.2f})"
    )
