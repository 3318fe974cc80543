"""Impossible values: not a number, beyond anything that moves on the ground, frozen."""

from collections.abc import Sequence

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.readers.ros.messages import Messages
from jerkbench.readers.text import require_possible
from jerkbench.recording import Imu
from jerkbench.sanitiser.ledger import DROPPED, Ledger

MOST_MPS2 = 1000.0
MOST_RADPS = 100.0
MOST_MPS = 200.0
"""Beyond these a value is damage: 100 g, 5700 deg/s, 720 km/h."""

FROZEN_ROWS = 10
"""An angular rate that is the same so often in a row is not measured: noise alone would move the last digit."""

REPEATED = 0.05
"""A part of repeated samples that is larger is said: the logger asks more often than the sensor measures."""

UNIT_WITHIN = 0.02
"""The largest difference of a unit quaternion's length from 1."""


def without_impossible(
    stream: str, messages: Messages, ledger: Ledger, limits: Sequence[tuple[str, float]]
) -> Messages:
    """Drop rows in which a field is no finite number, or its length is above its limit."""
    for field, most in limits:
        value = messages[field]
        finite: BoolArray = np.asarray(np.isfinite(value).all(axis=1))
        ledger.add(stream, f"a NaN or infinite {_in_words(field)}", ~finite, messages.bag_ns, DROPPED)
        messages = messages.rows(finite)
        with np.errstate(over="ignore"):
            over = np.linalg.norm(messages[field], axis=1) > most
        ledger.add(stream, f"an impossible {_in_words(field)}, above {most:g}", over, messages.bag_ns, DROPPED)
        messages = messages.rows(~over)
    return messages


def possible_imu(where: str, imu: Imu) -> Imu:
    """Return the samples, of which none is beyond what an IMU measures.

    Raises:
        RecordingError: one is, by damage or by a wrong unit; names ``where`` and the row.
    """
    for quantity, values, most in (
        ("specific force", imu.accel_mps2, MOST_MPS2),
        ("angular rate", imu.gyro_radps, MOST_RADPS),
    ):
        require_possible(f"{where}, {quantity}", values, most)
    return imu


def repeated_samples(imu: Imu) -> int:
    """Return how many samples repeat all six values of the one before."""
    same = (np.diff(imu.accel_mps2, axis=0) == 0).all(axis=1) & (np.diff(imu.gyro_radps, axis=0) == 0).all(axis=1)
    return int(same.sum())


def repeat_notes(imu: Imu) -> tuple[str, ...]:
    """Return a note where more than a twentieth of the samples repeat the one before, else none."""
    count, n = repeated_samples(imu), len(imu.t_s)
    if count <= REPEATED * n:
        return ()
    return (
        f"{count} of {n} IMU samples ({count / n:.0%}) repeat all values of the one before: they measure nothing new.",
    )


def without_frozen_gyro(stream: str, messages: Messages, ledger: Ledger, field: str = "angular_velocity") -> Messages:
    """Drop the rows of each run in which the angular rate stays the same, except the first of the run."""
    frozen = frozen_rows(messages[field])
    ledger.add(stream, "a frozen angular rate", frozen, messages.bag_ns, DROPPED)
    return messages.rows(~frozen)


def frozen_rows(values: FloatArray) -> BoolArray:
    """Return (n,) which of (n, k) repeat the row before, within runs of at least `FROZEN_ROWS`.

    A run at the very start is frozen as a whole: nothing was measured yet.
    """
    same = np.concatenate([[False], (np.diff(values, axis=0) == 0).all(axis=1)])[: len(values)]
    run = np.cumsum(~same)
    long = np.bincount(run, minlength=1)[run] >= FROZEN_ROWS if len(values) else same
    frozen: BoolArray = long & (same | (run == 1))
    return frozen


def without_bad_quaternions(stream: str, messages: Messages, ledger: Ledger, field: str = "orientation") -> Messages:
    """Drop rows whose quaternion is not of length 1."""
    bad = ~unit_quaternions(messages[field])
    ledger.add(stream, "an orientation that is no unit quaternion", bad, messages.bag_ns, DROPPED)
    return messages.rows(~bad)


def unit_quaternions(quaternions: FloatArray) -> BoolArray:
    """Return (n,) which of (n, 4) are of length 1."""
    with np.errstate(over="ignore", invalid="ignore"):
        unit: BoolArray = np.abs(np.linalg.norm(quaternions, axis=1) - 1.0) <= UNIT_WITHIN
    return unit


def _in_words(field: str) -> str:
    return {"linear": "linear velocity"}.get(field, field.replace("_", " "))
