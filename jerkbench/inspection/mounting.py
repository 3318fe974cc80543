"""An IMU that is not upright, turned about z or mirrored, or a track that is mirrored, by what both say of a motion."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.evidence import (
    SURE,
    Diagnosis,
    Turning,
    Windows,
    correlation_of,
    diagnosis,
    over_lengths,
    strength,
    track_windows,
    turning_gravity,
    turning_track,
    wheel_windows,
)
from jerkbench.io.frames import felt_axis
from jerkbench.recording import Imu, Recording

LEAST_FIT = 0.5
LEAST_GAIN = 0.4
"""Mended axes have to fit at least so well, and by so much better than the axes as they are (mean correlations)."""

VERY_SURE, SOME_GAIN = 10.0, 0.3
"""A fit that is weaker, of many noisy windows, has to be so many standard deviations from none, and so much better."""

LEAST_TURNING = 0.4
"""A turning that goes the other way has to correlate by so much."""

TILTING = 3.0
"""Of gravity's turning, the part about x and y has to go the other way by so many standard deviations."""

LEADS_S = (-1.4, -1.2, -1.0, -0.8, -0.6, -0.4, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4)
"""By so much may a hand turn before or after its walker."""

UPRIGHT_SHARE = 0.9
"""Gravity is on an axis where this part of it and more is."""

UPRIGHT = {
    "+z": ("x", "y", "z"),
    "-z": ("x", "-y", "-z"),
    "+x": ("y", "z", "x"),
    "-x": ("z", "y", "-x"),
    "+y": ("z", "x", "y"),
    "-y": ("x", "z", "-y"),
}
"""A right-handed body for each axis that gravity is felt on; which way is forward has to be measured."""

IDENTITY = "as they are"
MIRRORED_Y = "second axis the other way"
EXCHANGED = "axes exchanged"

PLANE = {
    IDENTITY: ((1, 0), (0, 1)),
    "turned by 90 degrees": ((0, -1), (1, 0)),
    "turned by 180 degrees": ((-1, 0), (0, -1)),
    "turned by -90 degrees": ((0, 1), (-1, 0)),
    "first axis the other way": ((-1, 0), (0, 1)),
    MIRRORED_Y: ((1, 0), (0, -1)),
    EXCHANGED: ((0, 1), (1, 0)),
    "axes exchanged, both the other way": ((0, -1), (-1, 0)),
}
"""What mends each way in which two horizontal axes are exchanged, turned or mirrored: (right axes) = P (given axes)."""


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
    basis: str

    @property
    def sure(self) -> bool:
        """Whether no other way could be meant."""
        return self.strength >= SURE and (self.correlation >= LEAST_FIT or self.strength >= VERY_SURE)

    @property
    def wrong(self) -> bool:
        """Whether the axes as they are cannot be right."""
        least = LEAST_GAIN if self.correlation >= LEAST_FIT else SOME_GAIN
        return self.sure and self.way != IDENTITY and self.correlation - self.as_given >= least

    @property
    def mirrors(self) -> bool:
        """Whether the way makes left-handed axes of right-handed ones."""
        return float(np.linalg.det(np.array(PLANE[self.way]))) < 0

    def __str__(self) -> str:
        """Return it as a part of a sentence."""
        correlations = f"(correlation {self.correlation:.2f}; as they are {self.as_given:.2f})"
        return f"{self.basis}, forward and left, fits the accelerometer with its axes {self.way} {correlations}"


def mended(values: FloatArray, way: str) -> FloatArray:
    """Return values (n, 2) with the axes mended."""
    return np.asarray(values @ np.array(PLANE[way], dtype=np.float64).T, dtype=np.float64)


def axes_text(way: str, names: tuple[str, str]) -> tuple[str, str]:
    """Return which of the axes given, called ``names``, is to become the first, and which the second: "-y", "x"."""
    first, second = (("-" if sum(row) < 0 else "") + names[0 if row[0] else 1] for row in PLANE[way])
    return first, second


def gravity_share(accel_mps2: FloatArray) -> tuple[str, float]:
    """Return the axis on which gravity is felt most, and which part of it (the cosine of the angle)."""
    force = np.abs(np.median(accel_mps2, axis=0))
    return felt_axis(accel_mps2), float(force.max() / np.linalg.norm(force)) if force.any() else 0.0


def mounting(recording: Recording) -> list[Diagnosis]:
    """Return what is wrong with the axes of the IMU, or with the east and north of the fixes.

    Gravity comes first: while it is not on +z, nothing else is said of axes. Then four witnesses: the track's forward
    and left acceleration against f, the same of a wheel, the track's turning against the gyro's z, and gravity's
    turning in the body against the gyro, whose sign a mirrored mounting changes and no rotation does.
    """
    if recording.imu is None:
        return []
    if felt_axis(recording.imu.accel_mps2) != "+z":
        return list(_not_upright(recording, recording.imu))
    return list(_judged(recording, recording.imu))


def _not_upright(recording: Recording, imu: Imu) -> Iterator[Diagnosis]:
    """Tell how to turn gravity to +z, where its axis is sure, or that all forces have the other sign.

    Without a track nothing says that the body is a vehicle: a sensor in a hand may lie on any side.
    """
    felt, share = gravity_share(imu.accel_mps2)
    if share <= UPRIGHT_SHARE or recording.position is None:
        return
    measured, fit = f"gravity is felt on {felt} (the cosine of the angle is {share:.2f})", plane_fit(recording)
    if felt == "-z" and fit is not None and fit.sure and fit.way == "turned by 180 degrees":
        yield diagnosis("accelerometer_reversed", f"{measured}, and {fit}")
    else:
        yield diagnosis("imu_not_upright", measured, felt=felt, axes=",".join(UPRIGHT[felt]))


def plane_fit(recording: Recording) -> Fit | None:
    """Return the best way, over the windows that say most; None without an IMU or without a track."""
    return _best_fit("the track's acceleration", over_lengths(track_windows, recording))


def _best_fit(basis: str, lengths: dict[float, Windows]) -> Fit | None:
    fits = []
    for windows in lengths.values():
        scores = {way: _score(windows, way) for way in PLANE}
        best = max(scores, key=lambda way: scores[way])
        fits.append(Fit(best, scores[best], scores[IDENTITY], strength(scores[best], len(windows)), basis))
    return max(fits, key=lambda fit: fit.strength, default=None)


def _score(windows: Windows, way: str) -> float:
    force = mended(windows.force_mps2[:, :2], way)
    return float(np.mean([correlation_of(windows.plane_mps2[:, axis], force[:, axis]) for axis in (0, 1)]))


def _judged(recording: Recording, imu: Imu) -> Iterator[Diagnosis]:
    """Weigh the witnesses: the mistake is where two of three agree on it.

    Gravity's turning has to show without the gyro's z axis, too: a slalom sways the force. Without a wheel a sensor
    that turns before it goes is in a hand: what the track says of its axes is not sure.
    """
    fit, track = plane_fit(recording), turning_track(recording)
    wheel = _best_fit("a wheel's acceleration", over_lengths(wheel_windows, recording))
    gravity, tilting = turning_gravity(imu), turning_gravity(replace(imu, gyro_radps=imu.gyro_radps * [1.0, 1.0, 0.0]))
    mirrored = _opposite(gravity) and tilting is not None and tilting.strength <= -TILTING
    if wheel is None and _leads(recording, track):
        fit = track = None
    if mirrored and (fit is None or not fit.wrong):
        yield diagnosis("imu_mirrored", _against(gravity), change="change the sign of one axis, most likely of y")
    elif _opposite(track) and not mirrored:
        yield from _against_the_gyro(_against(track), fit, wheel)
    elif fit is not None and fit.wrong:
        yield _turned(fit)
    elif (fit is None or not fit.sure) and wheel is not None and wheel.wrong:
        yield _turned(wheel)


def _opposite(turning: Turning | None) -> bool:
    return turning is not None and turning.correlation <= -LEAST_TURNING and turning.strength <= -SURE


def _leads(recording: Recording, track: Turning | None) -> bool:
    """Whether the track turns with the gyro best some time before or after it."""
    if track is None or (windows_at := track_windows(recording, track.length_s)) is None:
        return False
    shifted = [windows for lead_s in LEADS_S if (windows := windows_at(lead_s)) is not None]
    with_gyro = [correlation_of(windows.course_change_rad, windows.turn_rad[:, 2]) for windows in shifted]
    return max(with_gyro, default=0.0) > abs(track.correlation)


def _against_the_gyro(turning: str, fit: Fit | None, wheel: Fit | None) -> Iterator[Diagnosis]:
    """Tell which of two is mirrored: the accelerometer agrees with the gyro, or with the track."""
    mirrored = fit is not None and fit.wrong and fit.way == MIRRORED_Y
    if mirrored or (wheel is not None and wheel.sure and wheel.way == IDENTITY):
        yield diagnosis("track_mirrored", f"{turning}, and {fit if mirrored else wheel}")
    elif fit is not None and fit.sure and fit.way == IDENTITY:
        yield diagnosis("gyro_reversed", f"{turning}, while {fit}")
    else:
        yield diagnosis("either_mirrored", turning)


def _turned(fit: Fit) -> Diagnosis:
    x, y = axes_text(fit.way, ("x", "y"))
    if fit.mirrors:
        change = f"x has to be {x}, and y has to be {y}, of the axes as they are read now"
        return diagnosis("imu_mirrored", str(fit), change=change)
    return diagnosis("imu_turned", str(fit), turn=fit.way.replace("turned by", "to be turned by"), x=x, y=y)


def _against(turning: Turning | None) -> str:
    return "" if turning is None else f"{turning.basis} turns against the gyro (correlation {turning.correlation:.2f})"
