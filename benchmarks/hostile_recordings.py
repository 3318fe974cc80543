"""Recordings with damaged fields: tracks (NMEA, GPX, CSV) and arrays (HDF5, MATLAB)."""

import random
from collections.abc import Callable, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat

ROWS = 24

TEXTS = (
    *(
        "",
        "0",
        "-1",
        "3",
        "nan",
        "-inf",
        "1e400",
        "1_0",
        "0x1p3",
        "x",
        "\u00b0",
        "\x00",
        "-",
        ".",
        "+-1",
        "1e9",
        "1e-320",
    ),
    *("9" * 11, "9" * 400, "9" * 5000, "1" * 60_000, "." * 60_000, "0." + "7" * 60_000),
    *("9999-12-31T23:59:59Z", "0001-01-01T00:00:00+14:00", "2026-13-45T99:99:99Z", "1970-01-01", "2026-01-01T00:00:00"),
    *("000000", "999999", "311299", "235960.99", "4860.000", "-4807.038", "18000.1", "A", "V", "N", "W"),
)
"""Texts that replace a field."""


def track(number: int, seed: int, folder: Path) -> Path:
    """Write a track with a damaged field in some or all rows, and return its path."""
    rng = random.Random(f"{seed} {number}")  # noqa: S311 - not for cryptography
    name, rows, fields, assemble = rng.choice(FORMATS)
    damaged = [list(row) for row in rows]
    for _ in range(rng.choice((1, 1, 2, 5))):
        column, share = rng.randrange(fields), rng.choice((0.05, 0.5, 1.0))
        same = rng.choice(TEXTS)
        for row in damaged:
            if rng.random() < share and column < len(row):
                row[column] = rng.choice((same, same, rng.choice(TEXTS)))
                if rng.random() < 0.05:
                    row.pop(rng.randrange(len(row)))
    text = assemble(damaged)
    if rng.random() < 0.1:
        text = text[: rng.randrange(len(text))]
    path = folder / f"{number}{name}"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    return path


def _nmea(rows: Sequence[Sequence[str]]) -> str:
    bodies = [",".join(row) for row in rows]
    sums = [reduce(lambda a, b: a ^ b, body.encode(), 0) for body in bodies]
    return "".join(f"${body}*{checksum:02X}\n" for body, checksum in zip(bodies, sums, strict=True))


def _gpx(rows: Sequence[Sequence[str]]) -> str:
    escaped = [[text.replace("&", "").replace("<", "").replace('"', "") for text in row] for row in rows]
    points = [
        f'<trkpt lat="{row[0]}" lon="{row[1]}"><{row[2]}>{row[3]}</ele><time>{row[4]}</time></trkpt>'
        for row in ([*row, *[""] * 5] for row in escaped)
    ]
    return '<gpx version="1.1"><trk><trkseg>\n' + "\n".join(points) + "\n</trkseg></trk></gpx>\n"


NMEA_ROWS = [
    line.split(",")
    for k in range(ROWS)
    for line in (
        f"GPGGA,1200{k:02d}.00,4807.{k:03d},N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        f"GPRMC,1200{k:02d}.00,A,4807.{k:03d},N,01131.000,E,022.4,084.4,140524,003.1,W",
        f"GPGST,1200{k:02d}.00,,,,,1.5,2.5,4.0",
        f"GPZDA,1200{k:02d}.00,14,05,2024,00,00",
    )
]
STAMPS = [f"2024-05-14T12:00:{k:02d}Z" for k in range(ROWS)]
GPX_ROWS = [[f"{48 + k * 1e-5}", "11.5", "ele", "545.4", stamp] for k, stamp in enumerate(STAMPS)]
TABLE = "t,lat,lon,height,ax,ay,az,gx,gy,gz,ve,vn,vu"
TABLE_ROWS = [
    [
        f"{1.7e9 + k / 10:.1f}",
        f"{48 + k * 1e-5}",
        "11.5",
        "545.4",
        *["0.1", "0.2", "9.81", "0", "0", "0.1", "1", "0", "0"],
    ]
    for k in range(ROWS)
]


def _csv(rows: Sequence[Sequence[str]]) -> str:
    return "\n".join([TABLE, *map(",".join, rows), ""])


FORMATS: tuple[tuple[str, list[list[str]], int, Callable[[Sequence[Sequence[str]]], str]], ...] = (
    (".nmea", NMEA_ROWS, 15, _nmea),
    (".gpx", GPX_ROWS, 5, _gpx),
    (".csv", TABLE_ROWS, len(TABLE_ROWS[0]), _csv),
)
"""Formats: suffix, undamaged rows, number of fields, and the function that formats the rows."""


# Arrays: a trial of the data set BROAD as HDF5, and a table as MATLAB 5 and 7.3.

SHAPES = ((0,), (1,), (), (ROWS, 3), (3, ROWS), (2 * ROWS, 3), (ROWS, 65), (ROWS, 3, 1), (10**10, 3), (3 * 10**8, 3))
NUMBERS = (0.0, np.nan, np.inf, -1e300, 1e9, 2.0**63, 91.0, 1e-320)
TYPES = ("f8", "f4", "f2", "u8", "i8", "u1", "?", "c16", "S5", ">f8")
MAX_WRITTEN = 10**6


def arrays(number: int, seed: int, folder: Path) -> list[str]:
    """Write a file with a damaged array, link or byte, and return the arguments of the command that reads the file."""
    rng = random.Random(f"{seed} {number}")  # noqa: S311 - not for cryptography
    place = folder / str(number)
    place.mkdir()
    still = np.tile([0.0, 0.0, 9.81], (ROWS, 1))
    trial = {"imu_acc": still, "imu_gyr": np.zeros((ROWS, 3)), "opt_quat": np.tile([1.0, 0.0, 0.0, 0.0], (ROWS, 1))}
    trial |= {"movement": np.arange(ROWS) > ROWS // 2}
    table = {"t": 1.7e9 + np.arange(ROWS), "place": np.tile([48.0, 11.5, 545.4], (ROWS, 1))}
    kind = rng.choice(("broad", "broad", "mat", "mat 7.3"))
    whole = trial if kind == "broad" else table
    path = place / {"broad": "01_x.hdf5"}.get(kind, "m.mat")
    damaged = rng.choice(sorted(whole))
    values = _damaged(whole[damaged], rng)
    if kind == "mat":
        savemat(path, {**whole, damaged: values}, do_compression=rng.random() < 0.5)
    else:
        _write_hdf5(path, whole, damaged, values, rng)
    if rng.random() < 0.4:
        content = bytearray(path.read_bytes())
        for _ in range(rng.choice((1, 5, 50))):
            content[rng.randrange(len(content))] = rng.randrange(256)
        path.write_bytes(content[: rng.choice((None, None, rng.randrange(len(content))))])
    if kind == "broad":
        return ["data", "inspect", str(place), "--dataset", "broad", "--set", "trial=1", "remove_gyro_bias=false"]
    columns = "position_columns=[place_1,place_2,place_3]"
    return ["data", "inspect", str(place), "--dataset", "table", "--set", "position_file=m.mat", columns, "imu_file=''"]


def _damaged(values: np.ndarray[Any, Any], rng: random.Random) -> np.ndarray[Any, Any]:
    way = rng.choice(("value", "type", "shape", "none"))
    if way == "value":
        values = values.astype(np.float64)
        values[rng.choice((slice(None), 0, ROWS // 2))] = rng.choice(NUMBERS)
    elif way == "type":
        with np.errstate(all="ignore"):
            values = values.astype(rng.choice(TYPES))
    elif way == "shape":
        shape = rng.choice(SHAPES)
        values = np.zeros(shape if np.prod(shape) <= MAX_WRITTEN else 0)
    return values


def _write_hdf5(
    path: Path, whole: dict[str, np.ndarray[Any, Any]], damaged: str, values: np.ndarray[Any, Any], rng: random.Random
) -> None:
    with h5py.File(path, "w") as file:
        for name, array in whole.items():
            if name != damaged:
                file[name] = array.T if path.suffix == ".mat" else array
        file.attrs["sampling_rate"] = rng.choice((100.0, 100.0, 0.0, np.nan, "x", [1.0, 2.0], 1e300))
        shape = rng.choice(SHAPES[3:])
        ways: dict[str, Callable[[], object]] = {
            "values": lambda: file.__setitem__(damaged, values),
            "promise": lambda: file.create_dataset(
                damaged, shape, "f8", chunks=tuple(min(100, length) for length in shape), compression="gzip"
            ),
            "chunk": lambda: file.create_dataset(damaged, (ROWS, 3), "f8", chunks=(10**8, 3), maxshape=(None, None)),
            "outside": lambda: file.create_dataset(damaged, (ROWS, 3), "f8", external=[("/dev/zero", 0, 10**9)]),
            "link": lambda: file.__setitem__(damaged, h5py.ExternalLink("/dev/zero", "/x")),
            "circle": lambda: file.__setitem__(damaged, h5py.SoftLink(f"/{damaged}")),
            "group": lambda: file.__setitem__(damaged, file["/"]),
            "empty": lambda: file.__setitem__(damaged, h5py.Empty("f8")),
        }
        ways[rng.choice(("values", *ways))]()
