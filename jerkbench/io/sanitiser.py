"""Impossible measurements in arrays from any reader: places, dates, stamps, repeated values, and sizes of files."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import ecef_to_geodetic
from jerkbench.io.text import require_possible
from jerkbench.recording import Imu

MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG = 90.0, 360.0
MIN_HEIGHT_M, MAX_HEIGHT_M = -1000.0, 20_000.0
MAX_LOCAL_M = 1e8
"""No local or UTM coordinate is larger."""

MIN_DATE_NS, MAX_DATE_NS = (int(np.datetime64(year, "ns").astype(np.int64)) for year in ("1980", "2100"))
"""The dates of recordings, in nanoseconds since 1970."""

NO_FIX = "a place of zeros (no fix)"
OFF_EARTH = (
    f"a place that is not on Earth (latitude within {MAX_LATITUDE_DEG:g} deg, longitude within"
    f" {MAX_LONGITUDE_DEG:g} deg, height {MIN_HEIGHT_M:g} to {MAX_HEIGHT_M:g} m)"
)
HELD = "the values of the row before, held until the next measurement"
UNDATED = "a date that is not between 1980 and 2100"

MAX_MPS2, MAX_RADPS, MAX_MPS = 1000.0, 100.0, 200.0
"""Larger values are damage: 100 g, 5700 deg/s, 720 km/h."""

MAX_DAMAGED = 0.1
"""If a larger part of the values is too large, they are in another unit and not damaged."""

FROZEN_ROWS = 10
"""An angular rate that is the same so often in a row is not measured: noise alone would change the last digit."""

REPEATED = 0.05
"""A larger part of repeated samples is reported: the logger asks more often than the sensor measures."""

UNIT_WITHIN = 0.02
"""The largest difference of a unit quaternion's length from 1."""

LEAP_M, LEAP_MPS = 50.0, 100.0
"""A fix that is further from the median of its neighbours than this, plus this per second, is damage."""

IMU_GAP_S = 0.2
"""A longer step between two samples of the IMU is reported: in it a vehicle turns and brakes."""

MIN_HELD_RUNS, HELD_WITHIN = 10, 0.2
"""So many runs of equal values, half of them of the same length within this part, show that a logger holds a value."""

LATE_NS = 1_000_000_000
"""A row that is older than the one before by less came late; by more, a clock was set back."""

MAX_NUMBERS, MAX_RATIO = 16_000_000, 20
"""The numbers (of 8 bytes) that any file may hold, and the bytes of numbers for each byte of a larger file: measured
values can hardly be compressed, and a file of two kilobytes can promise gigabytes."""


def require_size(path: Path, numbers: int) -> None:
    """Check, before memory is allocated, how many numbers a file promises.

    Raises:
        RecordingError: they are far more than a file of this size can hold.
    """
    size = path.stat().st_size
    if numbers > max(MAX_NUMBERS, MAX_RATIO * size // 8):
        raise RecordingError(
            f"{path} has {size} bytes and promises {numbers:.3g} numbers, which need {numbers / 1.25e8:.3g} GB: it is"
            " damaged, or its arrays are empty; write only the measured rows."
        )


def require_origin(owner: str, origin: tuple[float, ...]) -> None:
    """Raise a PluginError unless there is no origin, or one on Earth."""
    given, parts = f"{owner}: origin is {origin}", "give latitude [deg], longitude [deg] and height [m]"
    if len(origin) not in (0, 3):
        raise PluginError(f"{given}; {parts}, or none.")
    if origin and (np.isnan(origin).any() or off_earth(np.array([origin]), "geodetic").any()):
        raise PluginError(f"{given}, which is not on Earth; {parts}, in this order.")


def off_earth(places: FloatArray, frame: str) -> BoolArray:
    """Return (n,) which places (n, 3) are impossible; a coordinate that is NaN was not measured.

    Args:
        places: latitude, longitude [deg] and height [m] in the frame "geodetic"; ECEF; or local coordinates [m].
        frame: of the places.
    """
    if frame not in ("geodetic", "ecef"):
        return np.asarray((np.abs(places) > MAX_LOCAL_M).any(axis=1))
    with np.errstate(all="ignore"):
        latitude, longitude, height = (ecef_to_geodetic(places) if frame == "ecef" else places).T
        bad = (np.abs(latitude) > MAX_LATITUDE_DEG) | (np.abs(longitude) > MAX_LONGITUDE_DEG)
    return np.asarray(bad | (height < MIN_HEIGHT_M) | (height > MAX_HEIGHT_M))


def without_fix(places: FloatArray, frame: str) -> BoolArray:
    """Return (n,) which places (n, 3) on the Earth are zeros that a logger wrote without a fix."""
    axes = {"geodetic": 2, "ecef": 3}.get(frame)
    return np.zeros(len(places), dtype=np.bool_) if axes is None else np.asarray((places[:, :axes] == 0).all(axis=1))


def undated(utc_ns: npt.ArrayLike) -> BoolArray:
    """Return (n,) which UTC times, in nanoseconds since 1970, are impossible."""
    return ~((np.asarray(utc_ns) >= MIN_DATE_NS) & (np.asarray(utc_ns) < MAX_DATE_NS))


def possible_rows(
    where: str,
    *,
    places: FloatArray | None = None,
    frame: str = "geodetic",
    utc_ns: npt.ArrayLike | None = None,
) -> tuple[BoolArray, tuple[str, ...]]:
    """Return (n,) which rows are possible, and a note for each fault that counts the others.

    Args:
        where: the file.
        places: (n, 3) as `off_earth` takes them.
        frame: of the places.
        utc_ns: (n,) as `undated` takes them.

    Raises:
        RecordingError: no row is possible.
    """
    faults = {} if places is None else {NO_FIX: without_fix(places, frame), OFF_EARTH: off_earth(places, frame)}
    faults |= {} if utc_ns is None else {UNDATED: undated(utc_ns)}
    bad = np.logical_or.reduce(list(faults.values()))
    if len(bad) and bad.all():
        worst = max(faults, key=lambda fault: faults[fault].sum())
        raise RecordingError(f"{where}: all {len(bad)} rows have {worst}; check the columns, their units and frame.")
    return ~bad, drop_notes(where, faults)


def drop_notes(where: str, faults: Mapping[str, BoolArray]) -> tuple[str, ...]:
    """Return a note for each fault that some rows have."""
    counts = {fault: (int(rows.sum()), len(rows)) for fault, rows in faults.items()}
    return tuple(
        f"{where}: {count} of {n} rows have {fault}: dropped." for fault, (count, n) in counts.items() if count
    )


def ordered_rows(where: str, t_ns: IntArray) -> tuple[IntArray, tuple[str, ...]]:
    """Return the rows in the order of their stamps, each stamp once, and notes that count what was done.

    Rows that came late are sorted in; those after a clock was set back by more than a second are dropped.

    Raises:
        RecordingError: they are so many that the rows are those of several logs.
    """
    highest = highest_before(t_ns)
    repeated, set_back = repeats_before(t_ns), t_ns <= highest - LATE_NS
    if len(t_ns) and set_back.mean() > MAX_DAMAGED:
        raise RecordingError(
            f"{where}: {int(set_back.sum())} of {len(t_ns)} rows are more than a second older than rows before them:"
            " they are of several logs or clocks; name one file, or cut the log where its clock was set."
        )
    order = np.flatnonzero(~set_back & ~repeated)
    late = int((t_ns[order] < highest[order]).sum())
    order = order[np.argsort(t_ns[order], kind="stable")]
    again = repeats_before(t_ns[order])
    repeated[order[again]] = True
    faults = {"the stamp of another row": repeated, "a stamp that was set back by seconds": set_back}
    notes = drop_notes(where, faults)
    if late:
        notes += (f"{where}: {late} of {len(t_ns)} rows are older than a row before them: sorted in.",)
    return order[~again], notes


def held_rows(values: FloatArray) -> BoolArray:
    """Return (n,) which rows repeat a measurement that a logger held until the next one.

    Measurements (n, k) come at a lower rate than the rows if they are equal to the bit in runs of nearly one length.
    The first row of each run counts, and in a longer run, as at rest, one row for each such length.
    """
    n = len(values)
    new = np.concatenate([[True], (values[1:] != values[:-1]).any(axis=1)])[:n]
    starts = np.flatnonzero(new)
    lengths = np.diff(np.append(starts, n))
    period = int(np.median(lengths)) if len(lengths) else 0
    alike = np.abs(lengths - period) <= max(1.0, HELD_WITHIN * period)
    if period < 2 or len(starts) < MIN_HELD_RUNS or np.mean(alike) < 0.5:
        return np.zeros(n, dtype=np.bool_)
    run = np.cumsum(new) - 1
    since = np.arange(n) - starts[run]
    measured = (since % period == 0) & ((since == 0) | (lengths[run] - since >= period / 2))
    return np.asarray(~measured)


def possible_imu(where: str, imu: Imu) -> tuple[Imu, tuple[str, ...]]:
    """Return the samples without those that no IMU measures, and a note that counts these.

    Raises:
        RecordingError: they are so many that the unit is wrong; names ``where`` and the first row.
    """
    beyond = (np.abs(imu.accel_mps2) > MAX_MPS2).any(axis=1) | (np.abs(imu.gyro_radps) > MAX_RADPS).any(axis=1)
    if beyond.mean() > MAX_DAMAGED:
        require_possible(f"{where}, specific force", imu.accel_mps2, MAX_MPS2)
        require_possible(f"{where}, angular rate", imu.gyro_radps, MAX_RADPS)
    if not beyond.any():
        return imu, ()
    fault = f"a specific force beyond {MAX_MPS2:g} m/s2 or an angular rate beyond {MAX_RADPS:g} rad/s"
    kept = Imu(imu.t_s[~beyond], imu.accel_mps2[~beyond], imu.gyro_radps[~beyond])
    return kept, drop_notes(Path(where).name, {fault: np.asarray(beyond)})


def impossible_speeds(mps: FloatArray) -> BoolArray:
    """Return (n,) which velocities (n, k) no land vehicle has, unless many rows have them."""
    beyond = np.asarray((np.abs(mps) > MAX_MPS).any(axis=1))
    return beyond if beyond.mean() <= MAX_DAMAGED else np.zeros(len(mps), dtype=np.bool_)


def repeated_samples(imu: Imu) -> int:
    """Return how many samples repeat all six values of the one before."""
    same = (np.diff(imu.accel_mps2, axis=0) == 0).all(axis=1) & (np.diff(imu.gyro_radps, axis=0) == 0).all(axis=1)
    return int(same.sum())


def repeat_notes(imu: Imu) -> tuple[str, ...]:
    """Return a note where more than a twentieth of the samples repeat the one before, else none."""
    count, n = repeated_samples(imu), len(imu.t_s)
    few = f"{count} of {n} IMU samples ({count / n:.0%}) repeat all values of the one before"
    return (f"{few}: they measure nothing new.",) if count > REPEATED * n else ()


def imu_gap_notes(imu: Imu | None) -> tuple[str, ...]:
    """Return a note that counts the gaps of the IMU, or none."""
    if imu is None or imu.largest_interval_s <= IMU_GAP_S:
        return ()
    steps_s = np.diff(imu.t_s)
    gaps_s = steps_s[steps_s > max(IMU_GAP_S, 2.5 * imu.nominal_interval_s)]
    if not len(gaps_s):
        return ()
    count = "1 gap" if len(gaps_s) == 1 else f"{len(gaps_s)} gaps"
    lost = "one sample stands for all: a turn or a change of speed there is lost, for every filter that uses the IMU"
    return (f"the IMU has {count} of up to {gaps_s.max():.2f} s, in which {lost}. Cut the recording there.",)


def frozen_rows(values: FloatArray) -> BoolArray:
    """Return (n,) which of (n, k) repeat the row before, within runs of at least `FROZEN_ROWS`.

    A run at the very start is frozen as a whole: nothing was measured yet.
    """
    same = np.concatenate([[False], (np.diff(values, axis=0) == 0).all(axis=1)])[: len(values)]
    run = np.cumsum(~same)
    long = np.bincount(run, minlength=1)[run] >= FROZEN_ROWS if len(values) else same
    return np.asarray(long & (same | (run == 1)))


def unit_quaternions(quaternions: FloatArray) -> BoolArray:
    """Return (n,) which of (n, 4) are of length 1."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.abs(np.linalg.norm(quaternions, axis=1) - 1.0) <= UNIT_WITHIN)


def steady_rows(t_s: FloatArray, position_m: FloatArray) -> tuple[BoolArray, tuple[str, ...]]:
    """Return (n,) which fixes do not leap, and a note that counts the others, or none.

    Raises:
        RecordingError: all of them leap.
    """
    leaps = leaping_rows(t_s, position_m)
    count, n = int(leaps.sum()), len(leaps)
    if count and count == n:
        raise RecordingError(
            f"All {n} fixes leap out of their neighbours by more than {LEAP_M:g} m; check the columns of the places,"
            " their frame and unit, and the times."
        )
    predicate = "leaps out of its" if count == 1 else "leap out of their"
    notes = (f"{count} of {n} fixes {predicate} neighbours by more than {LEAP_M:g} m: dropped.",) if count else ()
    return ~leaps, notes


def leaping_rows(t_s: FloatArray, position_m: FloatArray) -> BoolArray:
    """Return (n,) which are too far from the median of the five positions around them.

    An axis that is NaN was not measured: a position is judged by its other axes, each of them beside the nearest five
    that were. It leaps where, with the time that the five take::

        sum over the axes of (distance / (50 m + 100 m/s time))^2 > 1
    """
    over = np.zeros(len(position_m))
    for axis in position_m.T:
        known = np.flatnonzero(np.isfinite(axis))
        over[known] += _over_limit(t_s[known], axis[known]) ** 2
    return np.asarray(over > 1)


def _over_limit(t_s: FloatArray, axis_m: FloatArray) -> FloatArray:
    """Return (n,) each value's distance from the median of the five around it, over its limit; of fewer than 5, 0."""
    n = len(axis_m)
    if n < 5:
        return np.zeros(n)
    around = np.clip(np.arange(n), 2, n - 3)[:, None] + np.arange(-2, 3)  # at the ends the nearest five
    span_s = t_s[around[:, -1]] - t_s[around[:, 0]]
    return np.asarray(np.abs(axis_m - np.median(axis_m[around], axis=1)) / (LEAP_M + LEAP_MPS * span_s))


def repeats_before(stamp_ns: IntArray) -> BoolArray:
    """Return (n,) which stamps equal the one before."""
    return np.concatenate([[False], np.diff(stamp_ns) == 0])[: len(stamp_ns)]


def highest_before(stamp_ns: IntArray) -> IntArray:
    """Return (n,) the highest stamp before each row; of the first, one less than itself."""
    if not len(stamp_ns):
        return stamp_ns
    return np.concatenate([[stamp_ns[0] - 1], np.maximum.accumulate(stamp_ns)[:-1]])
