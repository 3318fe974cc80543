"""A table of unknown columns -> guesses with their reasons, in the order in which one rests on the other; a preset."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.datasets.table import Tables
from jerkbench.errors import RecordingError
from jerkbench.inspection.columns import (
    Name,
    Triple,
    common_unit,
    parse_name,
    position_columns,
    sensors_of,
    sigma_of,
    velocity_columns,
)
from jerkbench.inspection.guesses import (
    Guess,
    Value,
    guess_accel_unit,
    guess_angle_unit,
    guess_forward,
    guess_gyro_unit,
    guess_time_unit,
    guess_upright,
    guess_velocity_frame,
    is_date,
    turns_with_gyro,
)
from jerkbench.io.columns import Columns, read_columns
from jerkbench.io.frames import ACCEL_UNITS, GYRO_UNITS
from jerkbench.io.text import TextFormat
from jerkbench.recording import Recording

SEPARATORS = (",", ";", "\t")
OTHER = {"enu": "ned", "ned": "enu"}
SIGMA_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
HEAD = """\
# {name}: guessed from the columns of {file}. Correct what is unsure; `jerkbench show dataset table` lists the rest.
defaults:
  - table
  - _self_

folder: {folder}
separator: {separator}
"""

ECEF_M = (6.3e6, 6.45e6)
"""So far is the ground from the centre of the Earth."""


@dataclass
class Draft:
    """What is known of a table so far.

    Attributes:
        path: the file.
        separator: between its columns.
        columns: what was read.
        names: those that say something.
        guesses: in order.
    """

    path: Path
    separator: str
    columns: Columns
    names: list[Name]
    guesses: dict[str, Guess] = field(default_factory=dict)

    def add(self, *guesses: Guess) -> None:
        """Add guesses, or replace those of the same parameter."""
        self.guesses |= {guess.parameter: guess for guess in guesses}

    def name(self, why: str, **values: Value) -> None:
        """Add guesses by the names of columns."""
        self.add(*(Guess(parameter, value, "named", why) for parameter, value in values.items()))

    @property
    def settings(self) -> dict[str, Any]:
        """The parameters of the data set table."""
        fixed = {"folder": str(self.path.parent.resolve()), "separator": self.separator, "imu_file": ""}
        return fixed | {name: guess.value for name, guess in self.guesses.items()}

    @property
    def unused(self) -> list[str]:
        """Columns that no guess takes."""
        taken = {name for guess in self.guesses.values() for name in _words(guess.value)}
        return [column for column in self.columns.names if column not in taken]

    def load(self, **other: Any) -> Recording:  # noqa: ANN401 - parameters of any type
        """Return the recording that the guesses make."""
        return Tables(**{**self.settings, **other}).load()


def _words(value: Value) -> tuple[str, ...]:
    return value if isinstance(value, tuple) else (str(value),)


def guess_table(path: Path) -> Draft:
    """Return what the columns of a CSV are.

    Raises:
        RecordingError: it has no column of times, or neither an IMU nor places, by their names.
    """
    with path.open(encoding="utf-8", errors="replace") as lines:
        first = lines.readline()
    separator = next((mark for mark in SEPARATORS if mark in first), "")
    columns = read_columns((path,), TextFormat(separator))
    names = [name for column in columns.names if (name := parse_name(column)) is not None]
    draft = Draft(path, separator, columns, names)
    sensors, position, velocity = sensors_of(names), position_columns(names), velocity_columns(names)
    if sensors is None and position is None:
        raise RecordingError(
            f"{path} has the columns {', '.join(columns.names)}: no three of them are called a place, no six an"
            " accelerometer and a gyro; name them in the header, for example t, ax, gx, lat."
        )
    _times(draft, imu=sensors is not None, position=position is not None)
    if sensors is not None:
        _imu(draft, *sensors)
    if position is not None:
        _position(draft, position)
    if sensors is not None:
        _measure_imu(draft, sensors[1], position)
    if velocity is not None and position is not None:
        _velocity(draft, velocity)
    return draft


def _times(draft: Draft, *, imu: bool, position: bool) -> None:
    times = [name for name in draft.names if name.quantity == "time"]
    if len(times) != 1:
        count = "none" if not times else ", ".join(name.column for name in times)
        raise RecordingError(f"{draft.path} needs one column of times, and has {count}; call one of them t.")
    column, stamps = times[0].column, draft.columns.numbers([times[0].column])[:, 0]
    streams = [name for name, present in (("imu", imu), ("position", position)) if present]
    draft.name("its name", **{f"{stream}_time": column for stream in streams})
    unit = guess_time_unit(stamps, times[0].unit)
    date = is_date(stamps, str(unit.value))
    epoch = Guess("epoch", "unix", "unsure", "the stamps are dates; of UTC, or of GPS time, 18 s ahead")
    draft.add(unit, epoch if date else Guess("epoch", "none", "measured", "the stamps are no dates of our time"))


def _imu(draft: Draft, accel: Triple, gyro: Triple) -> None:
    draft.name("it has an IMU", imu_file=draft.path.name)
    draft.name("their names", imu_accel=accel.columns, imu_gyro=gyro.columns)
    force = draft.columns.numbers(accel.columns)
    force = force[np.isfinite(force).all(axis=1)]
    draft.add(guess_accel_unit(force, common_unit(accel.names, ACCEL_UNITS)), guess_upright(force))


def _position(draft: Draft, position: Triple) -> None:
    draft.name("it has places", position_file=draft.path.name)
    draft.name("their names", position_columns=position.columns)
    places = draft.columns.numbers(position.columns)
    _sigma(draft, np.asarray(np.isfinite(places).all(axis=1)))
    if position.frame == "geodetic":
        draft.name("the columns say so", position_frame="geodetic")
        draft.add(guess_angle_unit(places[:, 0], places[:, 1], common_unit(position.names[:2], {"deg": 0, "rad": 0})))
        return
    distance_m = float(np.nanmedian(np.linalg.norm(places, axis=1)))
    if ECEF_M[0] < distance_m < ECEF_M[1]:
        draft.add(Guess("position_frame", "ecef", "measured", f"{distance_m:.0f} m from zero, the Earth's radius"))
    elif position.frame:
        draft.name("the columns say so", position_frame=position.frame)
    else:
        draft.add(Guess("position_frame", "enu", "unsure", "x, y, z: the columns do not say it"))


def _sigma(draft: Draft, fixes: BoolArray) -> None:
    """Guess the standard deviations of the fixes in the rows ``fixes``: three columns that are positive there."""
    sigma = sigma_of(draft.names)
    if sigma is None or not (draft.columns.numbers(sigma.columns)[fixes] > 0).all():
        why = "the default: no column of it is guessed; give position_sigma"
        draft.add(Guess("position_sigma_m", 1.0, "unsure", why))
        return
    unit = common_unit(sigma.names, SIGMA_UNITS)
    grade, why = ("named", "the columns say so") if unit else ("unsure", "m: the columns do not say it")
    draft.name("their names", position_sigma=sigma.columns, position_covariance_frame=sigma.frame)
    draft.add(Guess("position_sigma_scale", SIGMA_UNITS[unit or "m"], grade, why))  # type: ignore[arg-type]


def _measure_imu(draft: Draft, gyro: Triple, position: Triple | None) -> None:
    """Weigh the gyro's unit first: all else compares turns or forces with the track."""
    upright = draft.guesses["imu_axes"]
    draft.add(guess_gyro_unit(draft.load(gyro_unit="rad/s"), common_unit(gyro.names, GYRO_UNITS)))
    if position is not None:
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


def _velocity(draft: Draft, velocity: Triple) -> None:
    draft.name("it has velocities", velocity_file=draft.path.name)
    draft.name("its name", velocity_time=draft.guesses["position_time"].value)
    draft.name("their names", velocity_columns=velocity.columns)
    why = "the default: no column of it is guessed; give velocity_sigma"
    draft.add(Guess("velocity_sigma_mps", 0.1, "unsure", why))
    if velocity.frame == "body":
        draft.name("the columns say so", velocity_frame="body")
    else:
        draft.add(guess_velocity_frame(draft.load(velocity_frame="enu"), velocity.frame))


def preset_text(draft: Draft, name: str) -> str:
    """Return the preset; JSON's values are YAML's."""
    quoted = {key: json.dumps(draft.settings[key], ensure_ascii=False) for key in ("folder", "separator")}
    lines = [] if "imu_file" in draft.guesses else ['imu_file: "" # there is no IMU']
    for guess in draft.guesses.values():
        value = json.dumps(guess.value, ensure_ascii=False)
        lines.append(f"{guess.parameter}: {value} # {guess.grade}: {guess.why}")
    return HEAD.format(name=name, file=draft.path.name, **quoted) + "\n".join(lines) + "\n"


def preset_path(path: Path) -> Path:
    """Return where a preset of a data set has to stand for ``--config-dir``: in a folder `dataset`."""
    named = path.with_suffix(".yaml")
    return named if named.parent.name == "dataset" else named.parent / "dataset" / named.name
