"""Guesses of the parameters for unknown table files, and the preset file that contains the guesses.

Each guess has a reason, and a guess may depend on previous guesses.
"""

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.datasets.table import Tables
from jerkbench.errors import RecordingError
from jerkbench.inspection.guesses import (
    Guess,
    Value,
    guess_accel_unit,
    guess_angle_unit,
    guess_forward,
    guess_gyro_unit,
    guess_height_unit,
    guess_time_unit,
    guess_upright,
    guess_velocity_frame,
    is_date,
    turns_with_gyro,
)
from jerkbench.inspection.lags import CLOCK_CORRELATION, SHIFT_PARAMETERS, all_lags
from jerkbench.inspection.noise import longest_rest
from jerkbench.io.column_names import (
    Name,
    Triple,
    accel_columns,
    common_unit,
    covariance_columns,
    gyro_columns,
    parse_name,
    position_columns,
    sigma_of,
    velocity_columns,
    with_meaning,
)
from jerkbench.io.columns import MAX_NANOSECONDS, Columns, TextFormat
from jerkbench.io.conversions import GPST_MINUS_UTC_S, SPEED_UNITS
from jerkbench.io.readers import SOLUTION, read_columns
from jerkbench.io.tracks import track_reader
from jerkbench.recording import Recording

SEPARATORS = (",", ";", "\t")
OTHER = {"enu": "ned", "ned": "enu"}
SIGMA_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
HEAD = """\
# {name}: guessed from the columns of {files}. Correct what is unsure; `jerkbench show dataset table` lists the rest.
defaults:
  - table
  - _self_

folder: {folder}
separator: {separator}
"""

DEFAULT = "default value, because no column was found; set"
ECEF_M = (6.3e6, 6.45e6)
"""Range of the distance of the ground from the Earth's centre."""

MIN_SHIFT_S = 0.05
"""Minimum lag [s] that is corrected by a shift."""

_MIN_FIXES = 10
OUTAGE_S, OUTAGE_STEPS = 5.0, 5.0
"""Minimum length of an outage [s], and minimum ratio to the median step of the fixes."""

SOON_S = 1.0
"""Latest start of a rest that counts as a rest at the start of the recording [s]."""


class GuessedTable(NamedTuple):
    """A table file with columns whose meaning is guessed.

    Attributes:
        path: path of the file.
        separator: separator of the columns; None for formats without a separator (NMEA, GPX, .pos of RTKLIB).
        columns: content of the file.
        names: column names whose meaning is known.
    """

    path: Path
    separator: str | None
    columns: Columns
    names: list[Name]

    @property
    def is_placed(self) -> bool:
        """True if the file has columns with positions."""
        return position_columns(self.names) is not None


@dataclass
class Draft:
    """The tables of a log and the guesses about their columns.

    Attributes:
        tables: table of each stream: imu, gyro (if the gyro is in another file), position, velocity, reference. One
            table may contain several streams.
        guesses: guesses by the name of their parameter, in the order in which they were added.
    """

    tables: dict[str, GuessedTable]
    guesses: dict[str, Guess] = field(default_factory=dict)

    def add(self, *guesses: Guess) -> None:
        """Add guesses. A guess replaces an earlier guess of the same parameter."""
        self.guesses |= {guess.parameter: guess for guess in guesses}

    def name(self, why: str, **values: Value) -> None:
        """Add several guesses that have the grade "named" and the same reason."""
        self.add(*(Guess(parameter, value, "named", why) for parameter, value in values.items()))

    @property
    def paths(self) -> list[Path]:
        """The paths of the files of all tables, without duplicates."""
        return list(dict.fromkeys(table.path for table in self.tables.values()))

    @property
    def folder(self) -> Path:
        """The common parent folder of the files of all tables."""
        return Path(os.path.commonpath([path.parent for path in self.paths]))

    def file(self, stream: str) -> str:
        """Return the path of the file of a stream, relative to the common folder."""
        return self.tables[stream].path.relative_to(self.folder).as_posix()

    @property
    def settings(self) -> dict[str, Any]:
        """The parameters of the data set `table` that result from the guesses."""
        separators = {table.separator for table in self.tables.values() if table.separator is not None}
        fixed = {"folder": str(self.folder), "separator": next(iter(separators), ","), "imu_file": ""}
        return fixed | {name: guess.value for name, guess in self.guesses.items()}

    @property
    def unused(self) -> list[str]:
        """The names of the columns that no guess uses."""
        taken = {name for guess in self.guesses.values() for name in _columns_of(guess.value)}
        tables = {table.path: table for table in self.tables.values()}.values()
        return list(dict.fromkeys(name for table in tables for name in table.columns.names if name not in taken))

    def load(self, **other: Any) -> Recording:  # noqa: ANN401 - parameters of any type
        """Load the recording with the guessed parameters. The parameters in ``other`` replace guesses."""
        return Tables(**{**self.settings, **other}).load()


def _columns_of(value: Value) -> tuple[str, ...]:
    return value if isinstance(value, tuple) else (str(value),)


def guess_tables(*paths: Path) -> Draft:
    """Return a draft with guesses about the columns of one or several files.

    The first file with an accelerometer and a gyro contains the IMU data. The first file with positions contains the
    fixes, and a second file with positions contains the reference.

    Raises:
        RecordingError: a file has no column that is recognised as the time, or no columns that are recognised as an IMU
            or as positions, or the files cannot be combined.
    """
    draft = Draft(_streams([_table(path.resolve()) for path in paths]))
    imu, position, velocity, reference = map(draft.tables.get, ("imu", "position", "velocity", "reference"))
    _times(draft)
    gyro = _imu(draft, imu) if imu else None
    if position and position.path.suffix == SOLUTION:
        draft.name("a solution of RTKLIB", position_file=draft.file("position"), position_frame="geodetic")
    elif position:
        draft.name("the file has positions", position_file=draft.file("position"))
        places = _places(draft, position, "position_columns", "position_frame")
        _sigma(draft, position, np.asarray(np.isfinite(places).all(axis=1)))
    if gyro:
        _measure_imu(draft, gyro)
    if velocity:
        _velocity(draft, velocity)
    if reference:
        _reference(draft, reference)
    # Loading fails if local and geodetic positions have no common origin. The user sees this error later.
    with suppress(RecordingError):
        for guesses in (_shifts, _outages, _rest):
            draft.add(*guesses(draft, draft.load()))
    return draft


def _table(path: Path) -> GuessedTable:
    separator = None
    if track_reader(path) is None and path.suffix != SOLUTION:
        with path.open(encoding="utf-8", errors="replace") as lines:
            first = lines.readline()
        separator = next((mark for mark in SEPARATORS if mark in first), "")
    columns = read_columns((path,), TextFormat(separator or ""))
    names = [name for column in columns.names if (name := parse_name(column, path.stem)) is not None]
    return GuessedTable(path, separator, columns, names)


def _streams(tables: Sequence[GuessedTable]) -> dict[str, GuessedTable]:
    accels, gyros = ([table for table in tables if find(table.names)] for find in (accel_columns, gyro_columns))
    complete = [table for table in accels if table in gyros]
    inertial, gyros = (complete, []) if complete else (accels, gyros)
    placed = [table for table in tables if table.is_placed]
    lacking = not complete and len(inertial) != len(gyros)
    for table in tables:
        if table not in (*inertial, *gyros, *placed) or (lacking and table in inertial and not table.is_placed):
            raise RecordingError(
                f"{table.path} has the columns {', '.join(table.columns.names)}. Neither the three columns of a"
                " position nor the six columns of an accelerometer and a gyro (which may be in two files) were"
                " recognised. Name the columns in the header, for example t, ax, gx, lat, or leave this file out."
            )
    separators = {table.separator for table in tables if table.separator is not None}
    if len(inertial) > 1 or len(gyros) > 1 or len(placed) > 2 or len(separators) > 1:
        names = ", ".join(table.path.name for table in tables)
        raise RecordingError(
            f"{names} cannot be combined. Give one file with an IMU, one with fixes and one with a reference, in this"
            f" order and with the same separator (found: {' and '.join(map(repr, sorted(separators)))})."
        )
    inertial = [] if lacking else inertial
    streams = {name: found[0] for name, found in (("imu", inertial), ("gyro", gyros)) if found}
    streams |= dict(zip(("position", "reference"), placed, strict=False))
    if placed and velocity_columns(placed[0].names):
        streams["velocity"] = placed[0]
    return streams


def _times(draft: Draft) -> None:
    """Guess the time column, its unit and its epoch for each stream. All streams without dates have the same epoch."""
    epochs: dict[str, Guess] = {}
    inertial = [draft.tables.get("imu"), draft.tables.get("gyro")]
    for stream, table in draft.tables.items():
        time = with_meaning(table.names, "time") or with_meaning(table.names, "tow")
        if time is None:
            named = ", ".join(name.column for name in table.names if name.quantity in ("time", "tow")) or "none"
            raise RecordingError(f"{table.path} needs exactly one time column; found: {named}. Name the time column t.")
        draft.name("from its name", **{f"{stream}_time": time.column})
        if table.columns.dates_ns(time.column, GPST_MINUS_UTC_S) is not None:
            epochs.setdefault("dates", Guess("epoch", "unix", "measured", "the stamps are dates"))
            continue
        stamps = table.columns.numbers([time.column], MAX_NANOSECONDS)[:, 0]
        week = with_meaning(table.names, "week")
        of_week, fixes = time.quantity == "tow" or week is not None, table not in inertial
        unit = guess_time_unit(stamps[np.isfinite(stamps)], time.unit, fixes=fixes, of_week=of_week)
        common = draft.guesses.get("time_unit", unit)
        if unit.grade == "unsure":
            unit = common
        if unit.value != common.value:
            unit = replace(unit, parameter=f"{stream}_time_unit")
        draft.add(unit)
        dated = not of_week and unit.grade != "unsure" and is_date(stamps, str(unit.value))
        epoch = _epoch(draft, week, dated=dated, of_week=of_week)
        epochs[str(epoch.value)] = epoch
    counted = [epoch for name, epoch in epochs.items() if name != "dates"]
    if len(counted) > 1 or ("dates" in epochs and "none" in epochs):
        raise RecordingError(
            f"{', '.join(path.name for path in draft.paths)}: some stamps are dates and others are not, or the stamps"
            " have different epochs; use the same clock in all files."
        )
    draft.add(*(counted or epochs.values()))


def _epoch(draft: Draft, week: Name | None, *, dated: bool, of_week: bool) -> Guess:
    if week is not None:
        draft.name("from its name", time_week=week.column)
        return Guess("epoch", "gps", "named", "the file has a column of GPS weeks")
    if dated:
        return Guess("epoch", "unix", "unsure", "the stamps are dates in UTC or in GPS time, which is 18 s ahead")
    if of_week:
        return Guess("epoch", "none", "named", "time of the GPS week without a column of the week")
    return Guess("epoch", "none", "measured", "the stamps are not plausible dates")


def _imu(draft: Draft, table: GuessedTable) -> Triple:
    """Add guesses about the columns of the IMU, and return the columns of the gyro."""
    of_gyro = draft.tables.get("gyro", table)
    accel, gyro = accel_columns(table.names), gyro_columns(of_gyro.names)
    assert accel is not None  # noqa: S101 - the stream has them
    assert gyro is not None  # noqa: S101 - the stream has them
    draft.name("the file has an IMU", imu_file=draft.file("imu"))
    draft.name("from their names", imu_accel=accel.columns, imu_gyro=gyro.columns)
    if of_gyro is not table:
        draft.name("the file has the gyro", gyro_file=draft.file("gyro"))
    instance, force = with_meaning(table.names, "instance"), table.columns.numbers(accel.columns)
    if instance is not None and len(sensors := np.unique(table.columns.numbers([instance.column]))) > 1:
        why = f"the file has rows of {len(sensors)} sensors; the first sensor is used"
        draft.name(why, imu_instance_column=instance.column, imu_instance=float(sensors[0]))
    force = force[np.isfinite(force).all(axis=1)]
    draft.add(guess_accel_unit(force, accel.names), guess_upright(force))
    return gyro


def _places(draft: Draft, table: GuessedTable, columns: str, frame: str) -> FloatArray:
    """Add guesses about the columns and the frame of the positions, and return the positions (n, 3)."""
    position = position_columns(table.names)
    assert position is not None  # noqa: S101 - the stream has them
    draft.name("from their names", **{columns: position.columns})
    places = table.columns.numbers(position.columns)
    distance_m = float(np.nanmedian(np.linalg.norm(places, axis=1)))
    if position.frame:
        draft.name("stated by the columns", **{frame: position.frame})
    elif ECEF_M[0] < distance_m < ECEF_M[1]:
        draft.add(Guess(frame, "ecef", "measured", f"the distance from zero is {distance_m:.0f} m, the Earth's radius"))
    else:
        draft.add(Guess(frame, "enu", "unsure", "x, y, z: not stated by the columns"))
    if position.frame == "geodetic":
        angle = guess_angle_unit(places[:, 0], places[:, 1], position.names[:2])
        height = guess_height_unit(places[:, 2], position.names[2].unit, str(angle.value))
        _add_units(draft, angle, height or Guess("height_unit", "m", "measured", "the heights are plausible in m"))
    return places


def _add_units(draft: Draft, angle: Guess, height: Guess) -> None:
    """Add the units of the fixes, or the units of the reference that differ from the units of the fixes."""
    if "angle_unit" not in draft.guesses:
        draft.add(angle, *([height] if height.value != "m" else []))
        return
    for guess in (angle, height):
        of_fixes = draft.guesses[guess.parameter].value if guess.parameter in draft.guesses else "m"
        if guess.value != of_fixes:
            draft.add(replace(guess, parameter=f"reference_{guess.parameter}"))


def _sigma(draft: Draft, table: GuessedTable, fixes: BoolArray) -> None:
    """Guess the columns of the covariance, or of standard deviations that are positive in all rows ``fixes``."""
    if covariance := covariance_columns(table.names):
        frame = "ned" if draft.guesses["position_frame"].value == "ned" else "enu"
        draft.name("from their names", position_covariance=covariance, position_covariance_frame=frame)
        return
    sigma = sigma_of(table.names)
    values = np.zeros((1, 3)) if sigma is None else table.columns.numbers(sigma.columns)[fixes]
    if sigma is None or not (values > 0).any() or (values <= 0).any():  # a fix without a sigma (NaN) is allowed
        draft.add(Guess("position_sigma_m", 1.0, "unsure", f"{DEFAULT} position_sigma"))
        return
    unit = common_unit(sigma.names, SIGMA_UNITS) or ("m" if table.separator is None else "")
    grade, why = ("named", "stated by the columns") if unit else ("unsure", "m: not stated by the columns")
    draft.name("from their names", position_sigma=sigma.columns, position_covariance_frame=sigma.frame)
    draft.add(Guess("position_sigma_scale", SIGMA_UNITS[unit or "m"], grade, why))  # type: ignore[arg-type]


def _measure_imu(draft: Draft, gyro: Triple) -> None:
    """Guess the unit of the gyro, the frame of the positions, and the forward axis of the IMU.

    The unit of the gyro is guessed first, because the other guesses compare the gyro or forces with the track.
    """
    upright = draft.guesses["imu_axes"]
    draft.add(guess_gyro_unit(draft.load(gyro_unit="rad/s"), gyro.names))
    if "position" in draft.tables:
        draft.add(_rotated_frame(draft))
    draft.add(guess_forward(draft.load(), _columns_of(upright.value), upright))


def _rotated_frame(draft: Draft) -> Guess:
    """Guess the frame of the positions in which the track turns in the same direction as the gyro."""
    frame = draft.guesses["position_frame"]
    agrees, measured = turns_with_gyro(draft.load())
    if agrees is not False:
        return replace(frame, grade="measured" if agrees else frame.grade, why=f"{frame.why}; {measured}")
    if frame.value in OTHER and frame.grade == "unsure":
        return Guess("position_frame", OTHER[str(frame.value)], "measured", f"{frame.why}; read as enu, {measured}")
    why = f"{frame.why}, but {measured}: two columns may be swapped, or the gyro's axes may be left-handed"
    return replace(frame, grade="unsure", why=why)


def _velocity(draft: Draft, table: GuessedTable) -> None:
    velocity = velocity_columns(table.names)
    assert velocity is not None  # noqa: S101 - the stream has them
    draft.name("the file has velocities", velocity_file=draft.file("velocity"))
    if table.path.suffix == SOLUTION:
        return
    draft.name("from their names", velocity_columns=velocity.columns)
    draft.add(Guess("velocity_sigma_mps", 0.1, "unsure", f"{DEFAULT} velocity_sigma"))
    if unit := common_unit(velocity.names, SPEED_UNITS):
        draft.name("stated by the columns", velocity_unit=unit)
    if velocity.frame == "body" or table.separator is None:
        draft.name("stated by the columns", velocity_frame=velocity.frame)
    else:
        draft.add(*guess_velocity_frame(draft.load(velocity_frame="enu"), velocity.frame))


def _reference(draft: Draft, table: GuessedTable) -> None:
    draft.name("a second file with positions", reference_file=draft.file("reference"))
    _places(draft, table, "reference_position", "reference_frame")
    velocity, frame = velocity_columns(table.names), draft.guesses["reference_frame"].value
    if velocity and velocity.frame in ("enu", "ned"):
        draft.name("from their names", reference_velocity=velocity.columns)
        if velocity.frame != ("ned" if frame == "ned" else "enu"):
            draft.name("from their names", reference_velocity_frame=velocity.frame)
    draft.name("its file", reference_source=table.path.name)
    why = "set it to true if the reference is independent of the fixes"
    draft.add(Guess("reference_independent", value=False, grade="unsure", why=why))


def _shifts(draft: Draft, recording: Recording) -> Iterator[Guess]:
    """Yield a guessed time shift for each stream with a significant lag."""
    guessed = set(draft.guesses)
    for lag in all_lags(recording) if {"imu", "position"} <= set(draft.tables) else ():
        strong = lag.sure and lag.correlation >= CLOCK_CORRELATION and abs(lag.lag_s) > 2 * lag.within_s
        parameter = SHIFT_PARAMETERS[lag.stream]
        if strong and abs(lag.lag_s) >= MIN_SHIFT_S and parameter not in guessed:
            guessed.add(parameter)
            why = f"lag {lag.lag_s:+.2f} s +- {lag.within_s:.2f} s behind {lag.against}"
            yield Guess(parameter, round(-lag.lag_s, 2), "measured", why)


def _outages(draft: Draft, recording: Recording) -> Iterator[Guess]:
    """Guess the minimum duration of an outage, which is the larger of 5 s and five median intervals of the fixes."""
    position = recording.position
    if "reference" not in draft.tables or position is None or len(position.t_s) < _MIN_FIXES:
        return
    steps_s = np.diff(position.t_s)
    shortest_s = float(max(OUTAGE_S, OUTAGE_STEPS * np.median(steps_s)))
    if gaps := int((steps_s > shortest_s).sum()):
        why = f"number of longer gaps: {gaps}, up to {steps_s.max():.1f} s"
        yield Guess("outage_s", shortest_s, "measured", why)


MIN_BIAS_DEGPS = 0.02
"""Minimum gyro bias that is removed [deg/s]. The rotation of the Earth is 0.004 deg/s."""


def _rest(draft: Draft, recording: Recording) -> Iterator[Guess]:
    """If the IMU is at rest at the start, guess the duration of the rest, and whether the gyro has a bias."""
    rest = longest_rest(recording) if "imu" in draft.tables else None
    if rest is None or recording.imu is None or rest.begin_s >= SOON_S:
        return
    why = "until then the IMU is at rest, and the fixes do not contradict it"
    yield Guess("static_start_s", float(int(rest.end_s)), "measured", why)
    gyro_radps = rest.rows_of(recording.imu.t_s, recording.imu.gyro_radps)
    bias_degps = np.degrees(np.linalg.norm(gyro_radps.mean(axis=0)))
    if bias_degps > MIN_BIAS_DEGPS:
        why = f"the mean turn rate at rest is {bias_degps:.2g} deg/s"
        yield Guess("remove_gyro_bias", value=True, grade="measured", why=why)


def preset_text(draft: Draft, name: str) -> str:
    """Return the preset as YAML. The values are formatted as JSON, which is valid YAML."""
    quoted = {key: json.dumps(draft.settings[key], ensure_ascii=False) for key in ("folder", "separator")}
    lines = [] if "imu_file" in draft.guesses else ['imu_file: "" # no IMU']
    for guess in draft.guesses.values():
        value = json.dumps(guess.value, ensure_ascii=False)
        lines.append(f"{guess.parameter}: {value} # {guess.grade}: {guess.why}")
    files = " and ".join(path.name for path in draft.paths)
    return HEAD.format(name=name, files=files, **quoted) + "\n".join(lines) + "\n"


def preset_path(path: Path) -> Path:
    """Return the path of the preset file. For ``--config-dir``, the preset must be in a folder named `dataset`."""
    named = path.with_suffix(".yaml")
    return named if named.parent.name == "dataset" else named.parent / "dataset" / named.name
