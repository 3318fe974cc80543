"""Checks of arrays from any reader: impossible positions, dates and stamps, repeated values, and common times."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import ecef_to_geodetic
from jerkbench.io.conversions import ACCEL_UNITS, GYRO_UNITS, axes_to_judge, gravity_notes
from jerkbench.recording import Imu, Recording

MAX_NUMBER = 1e15
"""Maximum plausible measurement on a vehicle. A larger value is damaged and may overflow when it is squared."""

MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG = 90.0, 360.0
MIN_HEIGHT_M, MAX_HEIGHT_M = -1000.0, 20_000.0
MAX_LOCAL_M = 1e8
"""Maximum local or UTM coordinate."""

MIN_DATE_NS, MAX_DATE_NS = (int(np.datetime64(year, "ns").astype(np.int64)) for year in ("1980", "2100"))
"""Range of the dates of recordings, in nanoseconds since 1970."""

NO_FIX = "a position of zeros (no fix)"
OFF_EARTH = (
    f"a position that is not on Earth (latitude within {MAX_LATITUDE_DEG:g} deg, longitude within"
    f" {MAX_LONGITUDE_DEG:g} deg, height {MIN_HEIGHT_M:g} to {MAX_HEIGHT_M:g} m)"
)
HELD = "the values of the previous row, held until the next measurement"
UNDATED = "a date that is not between 1980 and 2100"

MAX_MPS2, MAX_RADPS, MAX_MPS = 1000.0, 100.0, 200.0
"""Maximum plausible values: 100 g, 5700 deg/s, 720 km/h."""

MAX_DAMAGED = 0.1
"""Maximum fraction of damaged values. If more values are too large, the values are in another unit."""

FROZEN_ROWS = 10
"""Minimum number of equal consecutive angular rates that are regarded as frozen, because noise changes the last digit.
"""

REPEATED = 0.05
"""Maximum fraction of repeated samples that is not reported. A logger that is faster than the sensor repeats samples.
"""

UNIT_WITHIN = 0.02
"""Maximum deviation of a unit quaternion's norm from 1."""

LEAP_M, LEAP_MPS = 50.0, 100.0
"""Maximum distance of a fix from the median of its neighbours: a constant, plus a speed times their time span."""

IMU_GAP_S = 0.2
"""Maximum step of the IMU that is not reported. In a longer step a vehicle may turn or brake."""

MIN_HELD_RUNS, HELD_WITHIN = 10, 0.2
"""Conditions for a logger that holds values: minimum number of runs of equal values, and relative tolerance of the run
length. The length of at least half of the runs must be the median length, within this tolerance."""

MAX_ROUNDED = 0.5
"""Maximum fraction of different rows with the stamp of the previous row, if all stamps are whole seconds."""

LATE_NS = 1_000_000_000
"""Maximum time by which a row that is sorted is older than a previous row. A larger time means that a clock was set
back."""


def require_origin(owner: str, origin: tuple[float, ...]) -> None:
    """Raise a PluginError if ``origin`` is not empty and not a position on Earth."""
    if origin and (len(origin) != 3 or np.isnan(origin).any() or off_earth(np.array([origin]), "geodetic").any()):
        wrong = f"{origin}, which is not on Earth" if len(origin) == 3 else f"{origin}"
        raise PluginError(
            f"{owner}: origin is {wrong}; give latitude [deg], longitude [deg] and height [m], or leave origin empty."
        )


def off_earth(places: FloatArray, frame: str) -> BoolArray:
    """Return a mask (n,) of impossible positions (n, 3). Coordinates that are NaN are not checked.

    Args:
        places: (n, 3) positions: latitude [deg], longitude [deg] and height [m], or coordinates in ECEF or a local
            frame [m].
        frame: frame of the positions.
    """
    if frame not in ("geodetic", "ecef"):
        return np.asarray((np.abs(places) > MAX_LOCAL_M).any(axis=1))
    with np.errstate(all="ignore"):
        latitude, longitude, height = (ecef_to_geodetic(places) if frame == "ecef" else places).T
        bad = (np.abs(latitude) > MAX_LATITUDE_DEG) | (np.abs(longitude) > MAX_LONGITUDE_DEG)
    return np.asarray(bad | (height < MIN_HEIGHT_M) | (height > MAX_HEIGHT_M))


def without_fix(places: FloatArray, frame: str) -> BoolArray:
    """Return a mask (n,) of geodetic or ECEF positions (n, 3) that are zero, because the receiver had no fix."""
    axes = {"geodetic": 2, "ecef": 3}.get(frame)
    return np.zeros(len(places), dtype=np.bool_) if axes is None else np.asarray((places[:, :axes] == 0).all(axis=1))


def undated(utc_ns: npt.ArrayLike) -> BoolArray:
    """Return a mask (n,) of UTC times, in nanoseconds since 1970, that are not between 1980 and 2100."""
    return ~((np.asarray(utc_ns) >= MIN_DATE_NS) & (np.asarray(utc_ns) < MAX_DATE_NS))


def possible_rows(
    where: str,
    *,
    places: FloatArray | None = None,
    frame: str = "geodetic",
    utc_ns: npt.ArrayLike | None = None,
) -> tuple[BoolArray, tuple[str, ...]]:
    """Return a mask (n,) of the rows with a possible position and time, and a note for each fault of the dropped rows.

    Args:
        where: name of the file, or of the topic of a bag, for messages.
        places: (n, 3) positions in ``frame``, or None to check only the times.
        frame: frame of the positions: geodetic [deg, deg, m], ecef [m] or a local frame [m].
        utc_ns: (n,) UTC times in nanoseconds since 1970, or None to check only the positions.

    Raises:
        RecordingError: all rows are impossible.
    """
    faults = {} if places is None else {NO_FIX: without_fix(places, frame), OFF_EARTH: off_earth(places, frame)}
    faults |= {} if utc_ns is None else {UNDATED: undated(utc_ns)}
    bad = np.logical_or.reduce(list(faults.values()))
    if len(bad) and bad.all():
        worst = max(faults, key=lambda fault: faults[fault].sum())
        raise RecordingError(f"{where}: all {len(bad)} rows have {worst}; check the columns, their units and frame.")
    return ~bad, drop_notes(where, faults)


def drop_notes(
    where: str, faults: Mapping[str, BoolArray], done: str = "dropped", since_s: FloatArray | None = None
) -> tuple[str, ...]:
    """Return a note for each fault that at least one row has. The note counts the rows with this fault.

    Args:
        where: name of the file, or of the topic of a bag, for the notes.
        faults: for each fault, a mask (n,) of the rows with this fault.
        done: text that states the treatment of the rows with a fault, for example "dropped".
        since_s: (n,) times of the rows since the start of a bag [s].
    """
    notes = []
    for fault, rows in faults.items():
        if count := int(rows.sum()):
            first = "" if since_s is None else f", the first {since_s[int(np.argmax(rows))]:.2f} s into the bag"
            notes.append(f"{where}: {count} of {len(rows)} rows have {fault}{first}: {done}.")
    return tuple(notes)


def require_fractions(where: str, t_ns: IntArray, changed: BoolArray) -> None:
    """Check that the stamps were not rounded to whole seconds when they were written.

    Args:
        where: name of the file for the message.
        t_ns: (n,) stamps of the rows, in the order of the file [ns].
        changed: (n,) whether each row has other values than the previous row.

    Raises:
        RecordingError: most rows have the stamp of the previous row but other values, and all stamps are whole seconds.
    """
    rounded = (np.diff(t_ns) == 0) & changed[1:]
    if len(rounded) and rounded.mean() > MAX_ROUNDED and not (t_ns % 1_000_000_000).any():
        rows = round(len(t_ns) / len(np.unique(t_ns)))
        raise RecordingError(
            f"{where}: the stamps are rounded to whole seconds (about {rows} different rows with each); write them with"
            " more digits."
        )


def ordered_rows(where: str, t_ns: IntArray) -> tuple[IntArray, tuple[str, ...]]:
    """Return the indices of the rows sorted by their stamps, and notes about late and dropped rows.

    A row whose stamp is older than a previous stamp by less than a second is sorted. A row is dropped if its stamp is
    repeated, or is older than a previous stamp by a second or more, because a clock was set back.

    Raises:
        RecordingError: more than 10 % of the rows are a second or more older than a previous row, because the rows come
            from several logs.
    """
    highest = np.maximum.accumulate(t_ns)
    set_back = t_ns <= highest - LATE_NS
    if set_back.sum() > MAX_DAMAGED * len(t_ns):
        raise RecordingError(
            f"{where}: {int(set_back.sum())} of {len(t_ns)} rows are more than 1 s older than previous rows. The rows"
            " are from several logs or clocks; select one file, or split the log at the time when its clock was set."
        )
    order = np.flatnonzero(~set_back)
    order = order[np.argsort(t_ns[order], kind="stable")]
    again = np.concatenate([[False], np.diff(t_ns[order]) == 0])[: len(order)]
    repeated, late = np.zeros((2, len(t_ns)), dtype=np.bool_)
    repeated[order[again]] = True
    order = order[~again]
    late[order] = t_ns[order] < highest[order]
    faults = {"the stamp of another row": repeated, "a stamp that was set back by seconds": set_back}
    of_late = drop_notes(where, {"a stamp older than a previous row": late}, "sorted")
    return order, (*drop_notes(where, faults), *of_late)


def held_rows(values: FloatArray) -> BoolArray:
    """Return a mask (n,) of the rows in which a logger repeats the previous measurement.

    The measurements (n, k) have a lower rate than the rows if equal consecutive rows form runs of nearly the same
    length. The first row of each run of equal rows is a measurement. If a run is longer than usual, for example at
    standstill, one new measurement is assumed for each typical run length.
    """
    n = len(values)
    new = np.concatenate([[True], (values[1:] != values[:-1]).any(axis=1)])[:n]
    starts = np.flatnonzero(new)
    lengths = np.diff(np.append(starts, n))
    period = int(np.median(lengths)) if len(lengths) else 0
    typical = np.abs(lengths - period) <= max(1.0, HELD_WITHIN * period)
    if period < 2 or len(starts) < MIN_HELD_RUNS or np.mean(typical) < 0.5:
        return np.zeros(n, dtype=np.bool_)
    run = np.cumsum(new) - 1
    since = np.arange(n) - starts[run]
    return np.asarray((since % period != 0) | ((since != 0) & (lengths[run] - since < period / 2)))


def require_possible(where: str, values: FloatArray, most: float) -> None:
    """Check that no absolute value exceeds ``most``. NaN is allowed.

    Raises:
        RecordingError: an absolute value exceeds ``most``. The error message names ``where`` and the first row with
            such a value.
    """
    rows = np.flatnonzero(beyond(values.reshape(len(values), -1), most))
    if len(rows):
        name = f"{where}, row {rows[0] + 1}"
        raise RecordingError(f"{name} has a value beyond {most:g}; it is damaged or in another unit.")


def beyond(values: FloatArray, most: float) -> BoolArray:
    """Return a mask (n,) of the rows of ``values`` (n, k) that contain an absolute value larger than ``most``."""
    return np.asarray((np.abs(values) > most).any(axis=1))


def impossible_speeds(mps: FloatArray) -> BoolArray:
    """Return a mask (n,) of velocities (n, k) that are impossible for a land vehicle.

    If more than 10 % of the velocities are impossible, the mask is False everywhere, because the unit is wrong.
    """
    rows = beyond(mps, MAX_MPS)
    return rows if rows.mean() <= MAX_DAMAGED else np.zeros(len(mps), dtype=np.bool_)


def imu_in_body(
    where: str, t_s: FloatArray, accel: FloatArray, gyro: FloatArray, units: tuple[str, str], turn: FloatArray
) -> tuple[Imu, tuple[str, ...]]:
    """Return the plausible IMU samples in body axes, m/s2 and rad/s, and notes about gravity and faulty samples.

    Args:
        where: path of the file, for messages.
        t_s: (n,) times of the samples [s].
        accel: (n, 3) specific force in the sensor's axes and unit.
        gyro: (n, 3) angular rate in the sensor's axes and unit.
        units: units of the specific force and of the angular rate.
        turn: (3, 3) matrix M with f_body = M f_sensor.

    Raises:
        RecordingError: more than 10 % of the samples are impossible, because the unit is wrong. The error message names
            ``where`` and the first impossible sample.
    """
    force, rate = accel * ACCEL_UNITS[units[0]] @ turn.T, gyro * GYRO_UNITS[units[1]] @ turn.T
    finite = np.asarray(np.isfinite(np.hstack([force, rate])).all(axis=1))
    faults = {
        "a specific force or an angular rate that is NaN or infinite": ~finite,
        f"a specific force beyond {MAX_MPS2:g} m/s2": beyond(force, MAX_MPS2),
        f"an angular rate beyond {MAX_RADPS:g} rad/s": beyond(rate, MAX_RADPS),
    }
    good = ~np.logical_or.reduce(list(faults.values()))
    if (~good).mean() > MAX_DAMAGED:
        require_possible(f"{where}, specific force", force, MAX_MPS2)
        require_possible(f"{where}, angular rate", rate, MAX_RADPS)
    imu = Imu(t_s[good], force[good], rate[good])
    of_axes = gravity_notes(imu.accel_mps2, "imu_axes")
    return imu, (*of_axes, *repeat_notes(imu), *drop_notes(Path(where).name, faults))


def repeated_samples(imu: Imu) -> int:
    """Return the number of IMU samples that repeat all six values of the previous sample."""
    same = (np.diff(imu.accel_mps2, axis=0) == 0).all(axis=1) & (np.diff(imu.gyro_radps, axis=0) == 0).all(axis=1)
    return int(same.sum())


def repeat_notes(imu: Imu) -> tuple[str, ...]:
    """Return a note if more than 5 % of the samples repeat the previous sample, otherwise an empty tuple."""
    count, n = repeated_samples(imu), len(imu.t_s)
    few = f"{count} of {n} IMU samples ({count / n:.0%}) repeat all values of the previous sample"
    return (f"{few}: they contain no new measurement.",) if count > REPEATED * n else ()


def imu_gap_notes(imu: Imu | None) -> tuple[str, ...]:
    """Return a note that counts the gaps between IMU samples, or an empty tuple if there are no gaps."""
    if imu is None or imu.largest_interval_s <= IMU_GAP_S:
        return ()
    steps_s = np.diff(imu.t_s)
    gaps_s = steps_s[steps_s > max(IMU_GAP_S, 2.5 * imu.nominal_interval_s)]
    if not len(gaps_s):
        return ()
    count = "1 gap" if len(gaps_s) == 1 else f"{len(gaps_s)} gaps"
    effect = "Filters that use the IMU miss turns and changes of speed in a gap"
    return (f"the IMU has {count} of up to {gaps_s.max():.2f} s. {effect}. Cut the recording there.",)


def frozen_rows(values: FloatArray) -> BoolArray:
    """Return a mask (n,) of the rows of ``values`` (n, k) that repeat the previous row in a long run of equal rows.

    A long run has at least `FROZEN_ROWS` rows. If a long run is at the start, its first row is also masked, because the
    sensor has not measured yet.
    """
    same = np.concatenate([[False], (np.diff(values, axis=0) == 0).all(axis=1)])[: len(values)]
    run = np.cumsum(~same)
    long = np.bincount(run, minlength=1)[run] >= FROZEN_ROWS if len(values) else same
    return np.asarray(long & (same | (run == 1)))


def unit_quaternions(quaternions: FloatArray) -> BoolArray:
    """Return a mask (n,) of the quaternions (n, 4) whose norm is 1, within `UNIT_WITHIN`."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.abs(np.linalg.norm(quaternions, axis=1) - 1.0) <= UNIT_WITHIN)


def steady_rows(
    where: str, t_s: FloatArray, places: FloatArray, frame: str = "geodetic"
) -> tuple[BoolArray, tuple[str, ...]]:
    """Return a mask (n,) of the fixes near their neighbours, and a note with the number of other fixes, if any.

    Args:
        where: name of the file, or of the topic of a bag, for messages.
        t_s: (n,) stamps of the fixes [s].
        places: (n, 3) positions in ``frame``.
        frame: frame of the positions: geodetic [deg, deg, m], ecef [m] or a local frame [m].

    Raises:
        RecordingError: all fixes are far from their neighbours (`leaping_rows`).
    """
    leaps = leaping_rows(t_s, axes_to_judge(places, frame))
    if len(leaps) and leaps.all():
        raise RecordingError(
            f"{where}: all {len(leaps)} fixes are more than {LEAP_M:g} m away from their neighbours; check the columns"
            " of the positions, their frame and unit, and the times."
        )
    return ~leaps, drop_notes(where, {f"a position more than {LEAP_M:g} m from its neighbours": leaps})


def leaping_rows(t_s: FloatArray, position_m: FloatArray) -> BoolArray:
    """Return a mask (n,) of the positions that are too far from the median of the five nearest rows in time.

    Axes that were not measured are NaN. Each axis is compared with the nearest five rows in which it was measured. A
    position is too far from its neighbours if the following condition is true, where distance is the distance from the
    median and time is the time span of the five rows::

        sum over the axes of (distance / (50 m + 100 m/s time))^2 > 1
    """
    over = np.zeros(len(position_m))
    for axis in position_m.T:
        known = np.flatnonzero(np.isfinite(axis))
        over[known] += _over_limit(t_s[known], axis[known]) ** 2
    return np.asarray(over > 1)


def _over_limit(t_s: FloatArray, axis_m: FloatArray) -> FloatArray:
    """Return the distance (n,) from the median of the nearest five values, divided by its limit, or 0 if n < 5."""
    n = len(axis_m)
    if n < 5:
        return np.zeros(n)
    around = np.clip(np.arange(n), 2, n - 3)[:, None] + np.arange(-2, 3)  # the five nearest rows
    span_s = t_s[around[:, -1]] - t_s[around[:, 0]]
    return np.asarray(np.abs(axis_m - np.median(axis_m[around], axis=1)) / (LEAP_M + LEAP_MPS * span_s))


# Check that the streams of a recording overlap in time. Streams that do not overlap have different clocks or drives.


def with_common_time(recording: Recording, way_out: str) -> Recording:
    """Return the recording, after a check that each stream overlaps in time with the IMU.

    In a recording without an IMU, each stream must overlap in time with the positions.

    Args:
        recording: the recording to check.
        way_out: advice at the end of the error message; it starts with the word "check".

    Raises:
        RecordingError: two streams do not overlap. The message contains the times of both streams.
    """
    known = None if recording.reference.empty else recording.reference
    measured = recording.position, recording.velocity, recording.heading
    streams = dict(zip(("positions", "velocities", "headings", "reference"), (*measured, known), strict=True))
    clock_s, whose = recording.clock_s, "IMU"
    if recording.imu is None and recording.position is not None:
        clock_s, whose = recording.position.t_s, "positions"
    for name, stream in streams.items():
        if stream is None or not len(stream.t_s):
            continue
        if stream.t_s[0] > clock_s[-1] or clock_s[0] > stream.t_s[-1]:
            raise RecordingError(
                f"{recording.name}: the {name} ({stream.t_s[0]:.3f} to {stream.t_s[-1]:.3f} s) and the {whose}"
                f" ({clock_s[0]:.3f} to {clock_s[-1]:.3f} s) do not overlap in time; {way_out}."
            )
    return recording


# Outages that occurred during the recording.


def with_recorded_outages(recording: Recording, shortest_s: float) -> Recording:
    """Return the recording with an outage for each gap between two fixes that is longer than ``shortest_s``.

    Args:
        recording: the recording; its existing outages are preserved.
        shortest_s: minimum length of an added outage [s], or 0 to add no outages.

    Raises:
        RecordingError: the reference has no positions in the gaps, for example because the fixes are the reference.
    """
    if not shortest_s or recording.position is None:
        return recording
    fix_s = recording.position.t_s[np.isfinite(recording.position.enu_m[:, :2]).all(axis=1)]
    long = np.flatnonzero(np.diff(fix_s) > shortest_s)
    windows_s = np.column_stack([fix_s[long], fix_s[long + 1]])
    begin_s, end_s = recording.outages_s[:, 0], recording.outages_s[:, 1]
    windows_s = windows_s[~((windows_s[:, :1] < end_s) & (windows_s[:, 1:] > begin_s)).any(axis=1)]
    truth_s = recording.reference.t_s if recording.reference.enu_m is not None else np.empty(0)
    if len(windows_s) and not ((truth_s > windows_s[:, :1]) & (truth_s < windows_s[:, 1:])).any():
        raise RecordingError(
            f"{recording.name}: outage_s is {shortest_s:g}, but the reference has no position in any of the"
            f" {len(windows_s)} gaps between fixes; give a separate reference, or set outage_s=0."
        )
    return replace(recording, outages_s=np.concatenate([recording.outages_s, windows_s]))
