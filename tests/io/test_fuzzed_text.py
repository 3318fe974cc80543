"""Damaged text, in every way that Hypothesis finds, is a recording or a sentence: never anything else."""

import struct
import tempfile
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jerkbench.datasets.rtklib import RtklibDrive
from jerkbench.datasets.table import Tables
from jerkbench.errors import JerkbenchError
from jerkbench.io.tracks import _POS_HEADER
from jerkbench.recording import Recording

START = datetime(2025, 7, 8, 19, 34, 18, tzinfo=UTC)
SWITCHED_OFF = {"rest_s": 0.0, "remove_gyro_bias": False, "scale_accel_to_gravity": False}

MARKS = (b",", b" ", b"\n", b"\r\n", b"\t", b"%", b"#", b'"', b"-", b".", b"\x00", b"\xff\xfe", "\u0663".encode())
NUMBERS = (b"nan", b"-inf", b"1e400", b"-1e308", b"1e308", b"0", b"1_0", b"9" * 25, b"True", b"1j")
DATES = (b"2025/13/45 99:99:99", b"0001/01/01 00:00:00", b"9999999999/1/1", b"2025/07/08 19:34:18.5+02:00")
PIECES = st.sampled_from((*MARKS, *NUMBERS, *DATES))


def pos_text():
    rows = []
    for k in range(12):
        stamp = (START + timedelta(seconds=0.25 * k)).strftime("%Y/%m/%d %H:%M:%S.%f")[:-3]
        rows.append(f"{stamp} 45.0 {10 + k * 1e-6:.9f} 100.0 1 9 .01 .01 .02 0 0 0 0 0 .5 2.0 .0 .1 .1 .2 0 0 0")
    return "\n".join([f"% {_POS_HEADER}", *rows, ""]).encode()


def imu_text():
    return "".join(f"0.0,0.1,1.0,1,2,3,{5000 + 10 * k}\n" for k in range(301)).encode()


def table_text():
    return ("t,ax,ay,az,gx,gy,gz\n" + "".join(f"{k / 100},0.1,0.2,9.81,0.0,0.1,0.2\n" for k in range(40))).encode()


@st.composite
def damaged(draw, whole):
    """The text with up to four pieces put in, taken out, written over or doubled; sometimes something else entirely."""
    if draw(st.integers(0, 9)) == 0:
        return draw(st.binary(max_size=300))
    content = whole
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(content)))
        end = min(len(content), begin + draw(st.sampled_from([0, 0, 1, 3, 20, 80, 5000])))
        piece = draw(st.one_of(PIECES, st.binary(max_size=6), st.just(b""), st.just(content[begin:end] * 2)))
        content = content[:begin] + piece + content[end:]
    return content


def loads_or_says_why(dataset):
    said = ""
    try:
        recording = dataset.load(0)
    except JerkbenchError as error:
        said = str(error)
    if said:
        assert len(said) > 20
    else:
        assert isinstance(recording, Recording)
        assert np.isfinite(recording.imu.accel_mps2).all()


FUZZED = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)


def rtklib(folder, *, pos, imu):
    (folder / "a.pos").write_bytes(pos)
    (folder / "a.csv").write_bytes(imu)
    head = b"TIMETAG RTKLIB".ljust(60, b"\0") + struct.pack("<IId", 0, int(START.timestamp()), 0.0)
    (folder / "a.csv.tag").write_bytes(head + struct.pack("<II", 3000, 1))
    return RtklibDrive(str(folder), **SWITCHED_OFF)


def test_what_is_whole_loads(tmp_path):
    assert len(rtklib(tmp_path, pos=pos_text(), imu=imu_text()).load(0).position.t_s) == 12
    (tmp_path / "imu.csv").write_bytes(table_text())
    assert len(Tables(str(tmp_path)).load(0).imu.t_s) == 40


@pytest.mark.slow
@FUZZED
@given(damaged(pos_text()))
def test_a_damaged_solution(pos):
    with tempfile.TemporaryDirectory() as folder:
        loads_or_says_why(rtklib(Path(folder), pos=pos, imu=imu_text()))


@FUZZED
@given(damaged(imu_text()))
def test_a_damaged_imu_log(imu):
    with tempfile.TemporaryDirectory() as folder:
        loads_or_says_why(rtklib(Path(folder), pos=pos_text(), imu=imu))


@pytest.mark.parametrize("header", [True, False])
@pytest.mark.parametrize("separator", [",", ""])
@settings(FUZZED, max_examples=30)
@given(content=damaged(table_text()))
def test_a_damaged_table(header, separator, content):
    columns = {} if header else {"imu_time": "1", "imu_accel": ("2", "3", "4"), "imu_gyro": ("5", "6", "7")}
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "imu.csv").write_bytes(content)
        loads_or_says_why(Tables(folder, separator=separator, header=header, comment="#", **columns))


@pytest.mark.slow
@FUZZED
@given(damaged(table_text()))
def test_a_damaged_table_of_fixes(content):
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "imu.csv").write_bytes(table_text())
        (Path(folder) / "fix.csv").write_bytes(content)
        for frame in ("geodetic", "ecef", "ned"):
            fixes = {"position_columns": ("ax", "ay", "az"), "position_sigma": ("gz",), "position_frame": frame}
            loads_or_says_why(Tables(folder, position_file="fix.csv", **fixes))


@pytest.mark.slow
@FUZZED
@given(st.lists(damaged(b"2011-09-26 13:02:25.594360375\n"), min_size=40, max_size=40))
def test_damaged_dates(lines):
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "imu.csv").write_bytes(table_text())
        (Path(folder) / "times.txt").write_bytes(b"".join(lines))
        loads_or_says_why(Tables(folder, imu_time="", time_file="times.txt"))
