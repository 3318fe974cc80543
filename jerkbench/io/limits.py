"""Limits that no real recording exceeds: places on the Earth, dates, and the memory that a small file may need."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import ecef_to_geodetic

MAX_LATITUDE_DEG, MAX_LONGITUDE_DEG = 90.0, 360.0
MIN_HEIGHT_M, MAX_HEIGHT_M = -1000.0, 20_000.0
MAX_LOCAL_M = 1e8
"""No local or UTM coordinate is larger."""

MIN_DATE_NS, MAX_DATE_NS = (int(np.datetime64(year, "ns").astype(np.int64)) for year in ("1980", "2100"))
"""The dates of recordings, in nanoseconds since 1970."""

OFF_EARTH = (
    f"a place that is not on Earth (latitude within {MAX_LATITUDE_DEG:g} deg, longitude within"
    f" {MAX_LONGITUDE_DEG:g} deg, height {MIN_HEIGHT_M:g} to {MAX_HEIGHT_M:g} m)"
)
UNDATED = "a date that is not between 1980 and 2100"


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

    Every reader calls this function, or, for the messages of a bag, the two above.

    Args:
        where: the file.
        places: (n, 3) as `off_earth` takes them.
        frame: of the places.
        utc_ns: (n,) as `undated` takes them.

    Raises:
        RecordingError: no row is possible.
    """
    faults = {} if places is None else {OFF_EARTH: off_earth(places, frame)}
    faults |= {} if utc_ns is None else {UNDATED: undated(utc_ns)}
    bad = np.logical_or.reduce(list(faults.values()))
    if len(bad) and bad.all():
        worst = max(faults, key=lambda fault: faults[fault].sum())
        raise RecordingError(f"{where}: all {len(bad)} rows have {worst}; check the columns, their units and frame.")
    counts = {fault: int(rows.sum()) for fault, rows in faults.items()}
    return ~bad, tuple(f"{where}: {n} of {len(bad)} rows have {fault}: dropped." for fault, n in counts.items() if n)


def require_origin(owner: str, origin: tuple[float, ...]) -> None:
    """Raise a PluginError unless there is no origin, or one on Earth."""
    given, parts = f"{owner}: origin is {origin}", "give latitude [deg], longitude [deg] and height [m]"
    if len(origin) not in (0, 3):
        raise PluginError(f"{given}; {parts}, or none.")
    if origin and (np.isnan(origin).any() or off_earth(np.array([origin]), "geodetic").any()):
        raise PluginError(f"{given}, which is not on Earth; {parts}, in this order.")


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
