"""An IMU that is not upright, turned about z or mirrored, or a track that is mirrored, by what both say of a motion."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.diagnosis.gyro import Turning, turning_gravity, turning_track
from jerkbench.inspection.diagnosis.plane import IDENTITY, MIRRORED_Y, PLANE, axes_text, mended
from jerkbench.inspection.diagnosis.relation import SURE, strength
from jerkbench.inspection.diagnosis.wheel import wheel_windows
from jerkbench.inspection.diagnosis.windows import LENGTHS_S, Windows, track_windows
from jerkbench.inspection.guess.values import upright
from jerkbench.inspection.peaks import correlation_of
from jerkbench.io.frames import felt_axis
from jerkbench.recording import Imu, Recording

LEAST_FIT = 0.5
LEAST_GAIN = 0.4
"""Mended axes have to fit at least so well, and by so much better than the axes as they are (mean correlations)."""

VERY_SURE, SOME_GAIN = 10.0, 0.3
"""A fit that is weaker, of many noisy windows, has to be so many standard deviations from none, and so much better."""

LEAST_TURNING = 0.4
"""A turning that goes the other way has to correlate by so much."""


class Fit(NamedTuple):
    """The way to mend the horizontal axes of the IMU that fits the track best.

    Attributes:
        way: one of `PLANE`.
        correlation: mean of forward and left, mended.
        as_given: the same of the axes as they are.
        strength: in standard deviations from none.
        basis: what it fits.
    """

    way: str
    correlation: float
    as_given: float
    strength: float
    basis: str = "the track's acceleration"

    @property
    def sure(self) -> bool:
        """Whether no other way could be meant."""
        return self.strength >= SURE and (self.correlation >= LEAST_FIT or self.strength >= VERY_SURE)

    @property
    def wrong(self) -> bool:
        """Whether the axes as they are cannot be right."""
        gain = self.correlation - self.as_given
        return (
            self.sure and self.way != IDENTITY and gain >= (LEAST_GAIN if self.correlation >= LEAST_FIT else SOME_GAIN)
        )


def mounting(recording: Recording) -> list[Diagnosis]:
    """Return what is wrong with the axes of the IMU, or with the east and north of the fixes.

    Gravity comes first: while it is not on +z, nothing else is said of axes. Then four witnesses: the track's forward
    and left acceleration against f, the same of a wheel, the track's turning against the gyro's z, and gravity's
    turning in the body against the gyro, whose sign a mirrored mounting changes and no rotation does.
    """
    if recording.imu is None:
        return []
    if felt_axis(recording.imu.accel_mps2) != "+z":
        return _not_upright(recording, recording.imu)
    fit, track, gravity = plane_fit(recording), turning_track(recording), turning_gravity(recording.imu)
    judged = list(_judged(fit, _opposite(track), _opposite(gravity), track, gravity))
    if judged or (fit is not None and fit.sure):
        return judged
    wheel = wheel_fit(recording)
    return [_turned(wheel)] if wheel is not None and wheel.wrong else []


def _not_upright(recording: Recording, imu: Imu) -> list[Diagnosis]:
    """Return how to turn gravity to +z, where its axis is sure, or that all forces have the other sign.

    Without a track nothing says that the body is a vehicle: a sensor in a hand may lie on any side.
    """
    felt, guess, fit = felt_axis(imu.accel_mps2), upright(imu.accel_mps2), plane_fit(recording)
    if guess.grade != "measured" or recording.position is None:
        return []
    if felt == "-z" and fit is not None and fit.sure and fit.way == "turned by 180 degrees":
        return [
            Diagnosis(
                "accelerometer reversed",
                f"{guess.why}, and {_fit_text(fit)}",
                "All three axes of the accelerometer have the other sign",
                "Change the sign of the accelerometer's columns",
            )
        ]
    return [
        Diagnosis(
            "IMU not upright",
            guess.why,
            f"The IMU's axes are not forward, left, up: gravity is on {felt}",
            f"Set imu_axes=[{','.join(map(str, guess.value))}] of the axes as they are read now, then ask again which"  # type: ignore[arg-type]
            " way is forward",
        )
    ]


def plane_fit(recording: Recording) -> Fit | None:
    """Return the best way, over the windows that say most; None without an IMU or without a track."""
    lengths = (track_windows(recording, length_s) for length_s in LENGTHS_S)
    fits = [_fit(windows) for windows in lengths if windows is not None]
    return max(fits, key=lambda fit: fit.strength, default=None)


def wheel_fit(recording: Recording) -> Fit | None:
    """Return the best way by what a wheel says; None without an IMU or without a wheel."""
    lengths = (wheel_windows(recording, length_s) for length_s in LENGTHS_S)
    fits = [_fit(windows)._replace(basis="a wheel's acceleration") for windows in lengths if windows is not None]
    return max(fits, key=lambda fit: fit.strength, default=None)


def _fit(windows: Windows) -> Fit:
    scores = {way: _score(windows, way) for way in PLANE}
    best = max(scores, key=lambda way: scores[way])
    return Fit(best, scores[best], scores[IDENTITY], strength(scores[best], len(windows)))


def _score(windows: Windows, way: str) -> float:
    force = mended(windows.force_mps2[:, :2], way)
    return float(np.mean([correlation_of(windows.plane_mps2[:, axis], force[:, axis]) for axis in (0, 1)]))


def _opposite(turning: Turning | None) -> bool:
    return turning is not None and turning.correlation <= -LEAST_TURNING and turning.strength <= -SURE


def _judged(
    fit: Fit | None, track_opposite: bool, gravity_opposite: bool, track: Turning | None, gravity: Turning | None
) -> Iterator[Diagnosis]:
    """Weigh the witnesses: the mistake is where two of three agree on it."""
    if track_opposite and track is not None and not gravity_opposite:
        if fit is not None and fit.wrong and fit.way == MIRRORED_Y:
            yield _mirrored_track(f"{_turning_text(track)}, and {_fit_text(fit)}")
        elif fit is not None and fit.sure and fit.way == IDENTITY:
            yield _backward_gyro(f"{_turning_text(track)}, while {_fit_text(fit)}")
        else:
            yield _either(_turning_text(track))
    elif fit is not None and fit.wrong:
        yield _turned(fit)
    elif gravity_opposite and gravity is not None:
        yield _mirrored_mounting(_turning_text(gravity), "change the sign of one axis, most likely of y")


def _turned(fit: Fit) -> Diagnosis:
    x, y = axes_text(fit.way, ("x", "y"))
    if np.linalg.det(np.array(PLANE[fit.way])) < 0:
        return _mirrored_mounting(_fit_text(fit), f"let x be {x} and y be {y} of what is read now")
    return Diagnosis(
        f"IMU {fit.way.replace('turned by', 'to be turned by')} about z",
        _fit_text(fit),
        f"The IMU is {fit.way} about z",
        f"Set imu_axes=[{x},{y},z] of the axes as they are read now",
    )


def _mirrored_mounting(measured: str, remedy: str) -> Diagnosis:
    return Diagnosis(
        "IMU mirrored",
        measured,
        "The IMU's axes are mirrored (left-handed)",
        f"Mend the columns of accelerometer and gyro, for imu_axes cannot mirror: {remedy}",
    )


def _mirrored_track(measured: str) -> Diagnosis:
    return Diagnosis(
        "track mirrored",
        measured,
        "The track is mirrored: east and north of the fixes are exchanged (NED for ENU, or latitude and longitude)",
        "Set position_frame=ned, or exchange the first two of position_columns",
    )


def _backward_gyro(measured: str) -> Diagnosis:
    return Diagnosis(
        "gyro z reversed", measured, "The gyro's z axis turns the other way", "Change the sign of the gyro's z column"
    )


def _either(measured: str) -> Diagnosis:
    return Diagnosis(
        "track or gyro mirrored",
        measured,
        "Either the track is mirrored (NED for ENU, latitude and longitude exchanged) or the gyro turns the other way",
        "Set position_frame=ned, exchange the first two of position_columns, or correct imu_axes",
    )


def _turning_text(turning: Turning) -> str:
    return f"{turning.basis} turns against the gyro (correlation {turning.correlation:.2f})"


def _fit_text(fit: Fit) -> str:
    return (
        f"{fit.basis}, forward and left, fits the accelerometer with its axes {fit.way} (correlation"
        f" {fit.correlation:.2f}; as they are {fit.as_given:.2f})"
    )
