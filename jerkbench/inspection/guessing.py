"""Tables of unknown columns -> guesses with their reasons, in the order in which one rests on the other; a preset."""

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
from jerkbench.io.clocks import GPST_MINUS_UTC_S
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
from jerkbench.io.columns import MAX_NANOSECONDS, SOLUTION, Columns, read_columns
from jerkbench.io.frames import SPEED_UNITS
from jerkbench.io.text import TextFormat
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

DEFAULT = "the default: no column of it is guessed; give"
ECEF_M = (6.3e6, 6.45e6)
"""So far is the ground from the centre of the Earth."""

MIN_SHIFT_S = 0.05
"""A smaller lag is left to the filter."""

_MIN_FIXES = 10
OUTAGE_S, OUTAGE_STEPS = 5.0, 5.0
"""A gap between fixes that is longer, and has so many times the usual step, is an outage."""

SOON_S = 1.0
"""A rest that begins later is not one at the start."""


class GuessedTable(NamedTuple):
    """A file with columns.

    Attributes:
        path: the file.
        separator: between its columns; None: it has none (NMEA, GPX, gpsd's JSON, RTKLIB's .pos).
        columns: what was read.
        names: those that say something.
    """

    path: Path
    separator: str | None
    columns: Columns
    names: list[Name]

    @property
    def is_placed(self) -> bool:
        """Whether it has places."""
        return position_columns(self.names) is not None


@dataclass
class Draft:
    """What is known of a log so far.

    Attributes:
        tables: the table of each stream: imu, gyro (if apart), position, velocity, reference; one may have several.
        guesses: in order.
    """

    tables: dict[str, GuessedTable]
    guesses: dict[str, Guess] = field(default_factory=dict)

    def add(self, *guesses: Guess) -> None:
        """Add guesses, or replace those of the same parameter."""
        self.guesses |= {guess.parameter: guess for guess in guesses}

    def name(self, why: str, **values: Value) -> None:
        """Add guesses by the names of columns."""
        self.add(*(Guess(parameter, value, "named", why) for parameter, value in values.items()))

    @property
    def paths(self) -> list[Path]:
        """The files."""
        return list(dict.fromkeys(table.path for table in self.tables.values()))

    @property
    def folder(self) -> Path:
        """The folder that all files are in, or below."""
        return Path(os.path.commonpath([path.parent for path in self.paths]))

    def file(self, stream: str) -> str:
        """The name of a stream's file in the folder."""
        return self.tables[stream].path.relative_to(self.folder).as_posix()

    @property
    def settings(self) -> dict[str, Any]:
        """The parameters of the data set table."""
        separators = {table.separator for table in self.tables.values() if table.separator is not None}
        fixed = {"folder": str(self.folder), "separator": next(iter(separators), ","), "imu_file": ""}
        return fixed | {name: guess.value for name, guess in self.guesses.items()}

    @property
    def unused(self) -> list[str]:
        """Columns that no guess takes."""
        taken = {name for guess in self.guesses.values() for name in _words(guess.value)}
        tables = {table.path: table for table in self.tables.values()}.values()
        return list(dict.fromkeys(name for table in tables for name in table.columns.names if name not in taken))

    def load(self, **other: Any) -> Recording:  # noqa: ANN401 - parameters of any type
        """Return the recording that the guesses make."""
        return Tables(**{**self.settings, **other}).load()


def _words(value: Value) -> tuple[str, ...]:
    return value if isinstance(value, tuple) else (str(value),)


def guess_tables(*paths: Path) -> Draft:
    """Return what the columns of one file, or of several, are.

    The first file with an accelerometer and a gyro is the IMU's. The first one with places has the fixes, a second one
    the reference.

    Raises:
        RecordingError: a file has no column of times, or neither an IMU nor places, by their names; or the files do not
            fit together.
    """
    draft = Draft(_streams([_table(path.resolve()) for path in paths]))
    imu, position, velocity, reference = map(draft.tables.get, ("imu", "position", "velocity", "reference"))
    _times(draft)
    gyro = _imu(draft, imu) if imu else None
    if position and position.path.suffix == SOLUTION:
        draft.name("it is a solution of RTKLIB", position_file=draft.file("position"), position_frame="geodetic")
    elif position:
        draft.name("it has places", position_file=draft.file("position"))
        places = _places(draft, position, "position_columns", "position_frame")
        _sigma(draft, position, np.asarray(np.isfinite(places).all(axis=1)))
    if gyro:
        _measure_imu(draft, gyro)
    if velocity:
        _velocity(draft, velocity)
    if reference:
        _reference(draft, reference)
    # fixes and reference of two kinds: what the guesses lack is said where they are loaded
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
    inertial = [table for table in tables if accel_columns(table.names)]
    gyros = [table for table in tables if gyro_columns(table.names) and table not in inertial]
    placed = [table for table in tables if table.is_placed]
    lacking = len(inertial) - len(gyros) != sum(gyro_columns(table.names) is not None for table in inertial)
    for table in tables:
        if table not in (*inertial, *gyros, *placed) or (lacking and table in inertial and not table.is_placed):
            raise RecordingError(
                f"{table.path} has the columns {', '.join(table.columns.names)}: no three of them are called a place,"
                " no six an accelerometer and a gyro (which may be two files); name them in the header, for example t,"
                " ax, gx, lat."
            )
    separators = {table.separator for table in tables if table.separator is not None}
    if len(inertial) > 1 or len(gyros) > 1 or len(placed) > 2 or len(separators) > 1:
        names = ", ".join(table.path.name for table in tables)
        raise RecordingError(
            f"{names}: give one file with an IMU, one with fixes and one with a reference, in this order, separated by"
            f" the same sign (here {' and '.join(map(repr, sorted(separators)))})."
        )
    inertial = [] if lacking else inertial
    streams = {name: found[0] for name, found in (("imu", inertial), ("gyro", gyros)) if found}
    streams |= dict(zip(("position", "reference"), placed, strict=False))
    if placed and velocity_columns(placed[0].names):
        streams["velocity"] = placed[0]
    return streams


def _times(draft: Draft) -> None:
    """Guess column and unit of each stream's times, and what they count from: the same for all but dates."""
    epochs: dict[str, Guess] = {}
    for stream, table in draft.tables.items():
        time = with_meaning(table.names, "time") or with_meaning(table.names, "tow")
        if time is None:
            named = ", ".join(name.column for name in table.names if name.quantity in ("time", "tow")) or "none"
            raise RecordingError(f"{table.path} needs one column of times, and has {named}; call one of them t.")
        draft.name("its name", **{f"{stream}_time": time.column})
        if table.columns.dates_ns(time.column, GPST_MINUS_UTC_S) is not None:
            epochs.setdefault("dates", Guess("epoch", "unix", "measured", "the stamps are dates"))
            continue
        stamps = table.columns.numbers([time.column], MAX_NANOSECONDS)[:, 0]
        week = with_meaning(table.names, "week")
        of_week, fixes = time.quantity == "tow" or week is not None, table not in _of_imu(draft)
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
            f"{', '.join(path.name for path in draft.paths)}: some stamps are dates and others are not, or they count"
            " from another day; write the times of all files by one clock."
        )
    draft.add(*(counted or epochs.values()))


def _of_imu(draft: Draft) -> list[GuessedTable]:
    return [draft.tables[stream] for stream in ("imu", "gyro") if stream in draft.tables]


def _epoch(draft: Draft, week: Name | None, *, dated: bool, of_week: bool) -> Guess:
    if week is not None:
        draft.name("its name", time_week=week.column)
        return Guess("epoch", "gps", "named", "it has a column of weeks")
    if dated:
        return Guess("epoch", "unix", "unsure", "the stamps are dates; of UTC, or of GPS time, 18 s ahead")
    if of_week:
        return Guess("epoch", "none", "named", "a time of the GPS week, and no column says which week")
    return Guess("epoch", "none", "measured", "the stamps are no dates of our time")


def _imu(draft: Draft, table: GuessedTable) -> Triple:
    """Guess the columns of the IMU; return those of the gyro."""
    of_gyro = draft.tables.get("gyro", table)
    accel, gyro = accel_columns(table.names), gyro_columns(of_gyro.names)
    assert accel is not None  # noqa: S101 - the stream has them
    assert gyro is not None  # noqa: S101 - the stream has them
    draft.name("it has an IMU", imu_file=draft.file("imu"))
    draft.name("their names", imu_accel=accel.columns, imu_gyro=gyro.columns)
    if of_gyro is not table:
        draft.name("it has the gyro", gyro_file=draft.file("gyro"))
    instance, force = with_meaning(table.names, "instance"), table.columns.numbers(accel.columns)
    if instance is not None and len(sensors := np.unique(table.columns.numbers([instance.column]))) > 1:
        why = f"rows of {len(sensors)} sensors are mixed; the first is used"
        draft.name(why, imu_instance_column=instance.column, imu_instance=float(sensors[0]))
    force = force[np.isfinite(force).all(axis=1)]
    draft.add(guess_accel_unit(force, accel.names), guess_upright(force))
    return gyro


def _places(draft: Draft, table: GuessedTable, columns: str, frame: str) -> FloatArray:
    """Guess which columns are places and in which frame; return them (n, 3)."""
    position = position_columns(table.names)
    if position is None:  # a stream of places has them
        raise RecordingError(f"{table.path} has no places.")
    draft.name("their names", **{columns: position.columns})
    places = table.columns.numbers(position.columns)
    distance_m = float(np.nanmedian(np.linalg.norm(places, axis=1)))
    if position.frame:
        draft.name("the columns say so", **{frame: position.frame})
    elif ECEF_M[0] < distance_m < ECEF_M[1]:
        draft.add(Guess(frame, "ecef", "measured", f"{distance_m:.0f} m from zero, the Earth's radius"))
    else:
        draft.add(Guess(frame, "enu", "unsure", "x, y, z: the columns do not say it"))
    if position.frame == "geodetic" and "angle_unit" not in draft.guesses:
        angle = guess_angle_unit(places[:, 0], places[:, 1], position.names[:2])
        height = guess_height_unit(places[:, 2], position.names[2].unit, str(angle.value))
        draft.add(angle, *([height] if height else []))
    return places


def _sigma(draft: Draft, table: GuessedTable, fixes: BoolArray) -> None:
    """Guess the standard deviations of the fixes in the rows ``fixes``: three columns that are positive there."""
    if nine := covariance_columns(table.names):
        draft.name("their names", position_covariance=nine)
        return
    sigma = sigma_of(table.names)
    values = np.zeros((1, 3)) if sigma is None else table.columns.numbers(sigma.columns)[fixes]
    if sigma is None or not (values > 0).any() or (values <= 0).any():  # they may be missing at some fixes
        draft.add(Guess("position_sigma_m", 1.0, "unsure", f"{DEFAULT} position_sigma"))
        return
    unit = common_unit(sigma.names, SIGMA_UNITS) or ("m" if table.separator is None else "")
    grade, why = ("named", "the columns say so") if unit else ("unsure", "m: the columns do not say it")
    draft.name("their names", position_sigma=sigma.columns, position_covariance_frame=sigma.frame)
    draft.add(Guess("position_sigma_scale", SIGMA_UNITS[unit or "m"], grade, why))  # type: ignore[arg-type]


def _measure_imu(draft: Draft, gyro: Triple) -> None:
    """Weigh the gyro's unit first: all else compares turns or forces with the track."""
    upright = draft.guesses["imu_axes"]
    draft.add(guess_gyro_unit(draft.load(gyro_unit="rad/s"), gyro.names))
    if "position" in draft.tables:
        draft.add(_turned_frame(draft))
    draft.add(guess_forward(draft.load(), _words(upright.value), upright))


def _turned_frame(draft: Draft) -> Guess:
    """Return the frame of the places, by whether the track turns with the gyro."""
    frame = draft.guesses["position_frame"]
    agrees, measured = turns_with_gyro(draft.load())
    if agrees is not False:
        return replace(frame, grade="measured" if agrees else frame.grade, why=f"{frame.why}; {measured}")
    if frame.value in OTHER and frame.grade == "unsure":
        return Guess("position_frame", OTHER[str(frame.value)], "measured", f"{frame.why}; read as enu, {measured}")
    why = f"{frame.why}, but {measured}: two columns may be exchanged, or the gyro's axes left-handed"
    return replace(frame, grade="unsure", why=why)


def _velocity(draft: Draft, table: GuessedTable) -> None:
    velocity = velocity_columns(table.names)
    if velocity is None:
        return
    draft.name("it has velocities", velocity_file=draft.file("velocity"))
    if table.path.suffix == SOLUTION:
        return
    draft.name("their names", velocity_columns=velocity.columns)
    draft.add(Guess("velocity_sigma_mps", 0.1, "unsure", f"{DEFAULT} velocity_sigma"))
    if unit := common_unit(velocity.names, SPEED_UNITS):
        draft.name("the columns say so", velocity_unit=unit)
    if velocity.frame == "body" or table.separator is None:
        draft.name("the columns say so", velocity_frame=velocity.frame)
    else:
        draft.add(*guess_velocity_frame(draft.load(velocity_frame="enu"), velocity.frame))


def _reference(draft: Draft, table: GuessedTable) -> None:
    draft.name("a second file with places", reference_file=draft.file("reference"))
    _places(draft, table, "reference_position", "reference_frame")
    velocity, frame = velocity_columns(table.names), draft.guesses["reference_frame"].value
    if velocity and velocity.frame == ("ned" if frame == "ned" else "enu"):
        draft.name("their names", reference_velocity=velocity.columns)
    draft.name("its file", reference_source=table.path.name)
    why = "whether it shares nothing with the fixes is yours to say"
    draft.add(Guess("reference_independent", value=False, grade="unsure", why=why))


def _shifts(draft: Draft, recording: Recording) -> Iterator[Guess]:
    """Guess what is added to the stamps of streams that are late or early for sure."""
    told = set(draft.guesses)
    for lag in all_lags(recording) if {"imu", "position"} <= set(draft.tables) else ():
        strong = lag.sure and lag.correlation >= CLOCK_CORRELATION and abs(lag.lag_s) > 2 * lag.within_s
        parameter = SHIFT_PARAMETERS[lag.stream]
        if strong and abs(lag.lag_s) >= MIN_SHIFT_S and parameter not in told:
            told.add(parameter)
            why = f"it is {lag.lag_s:+.2f} s late against {lag.against}, give or take {lag.within_s:.2f} s"
            yield Guess(parameter, round(-lag.lag_s, 2), "measured", why)


def _outages(draft: Draft, recording: Recording) -> Iterator[Guess]:
    """Guess which gaps between fixes are outages to score: of five seconds, and of five times the usual step."""
    position = recording.position
    if "reference" not in draft.tables or position is None or len(position.t_s) < _MIN_FIXES:
        return
    steps_s = np.diff(position.t_s)
    shortest_s = float(max(OUTAGE_S, OUTAGE_STEPS * np.median(steps_s)))
    if gaps := int((steps_s > shortest_s).sum()):
        yield Guess("outage_s", shortest_s, "measured", f"longer gaps: {gaps}, the longest {steps_s.max():.1f} s")


def _rest(draft: Draft, recording: Recording) -> Iterator[Guess]:
    """Guess how long it stands still at the start, where it does."""
    rest = longest_rest(recording) if "imu" in draft.tables else None
    if rest and rest.begin_s < SOON_S:
        why = "until then the IMU is quiet, and the fixes do not contradict"
        yield Guess("static_start_s", float(int(rest.end_s)), "measured", why)


def preset_text(draft: Draft, name: str) -> str:
    """Return the preset; JSON's values are YAML's."""
    quoted = {key: json.dumps(draft.settings[key], ensure_ascii=False) for key in ("folder", "separator")}
    lines = [] if "imu_file" in draft.guesses else ['imu_file: "" # there is no IMU']
    for guess in draft.guesses.values():
        value = json.dumps(guess.value, ensure_ascii=False)
        lines.append(f"{guess.parameter}: {value} # {guess.grade}: {guess.why}")
    files = " and ".join(path.name for path in draft.paths)
    return HEAD.format(name=name, files=files, **quoted) + "\n".join(lines) + "\n"


def preset_path(path: Path) -> Path:
    """Return where a preset of a data set has to stand for ``--config-dir``: in a folder `dataset`."""
    named = path.with_suffix(".yaml")
    return named if named.parent.name == "dataset" else named.parent / "dataset" / named.name
