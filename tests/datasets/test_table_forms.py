"""The forms that logs come in: cut at their ends, with two lines of names, with covariances, from MATLAB."""

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from jerkbench.datasets.table import Tables
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import enu_axes
from jerkbench.recording import Origin

N, DRAW = 200, np.random.default_rng(3)
IMU = np.column_stack([5.0 + np.arange(N) / 100, DRAW.normal([0, 0, 9.81, 0, 0, 0], 0.1, (N, 6))])
NAMES = ["t", "ax", "ay", "az", "gx", "gy", "gz"]
FIX_S = 5.0 + np.arange(10) * 0.2
PLACES = np.column_stack([np.arange(10.0), 0.5 * np.arange(10.0), np.zeros(10)])
FIXES = {"position_file": "fix.csv", "position_columns": ("e", "n", "u"), "position_frame": "enu"}


def imu_lines(rows=IMU):
    return [",".join(f"{value:.6f}" for value in row) for row in rows]


def imu_text(folder, *above, rows=IMU, below=""):
    (folder / "imu.csv").write_text("\n".join([*above, *imu_lines(rows)]) + "\n" + below)


def fixes(folder, **columns):
    table = {"t": FIX_S, "e": PLACES[:, 0], "n": PLACES[:, 1], "u": PLACES[:, 2], **columns}
    pd.DataFrame(table).to_csv(folder / "fix.csv", index=False)


def numbered():
    return {"imu_time": "1", "imu_accel": ("2", "3", "4"), "imu_gyro": ("5", "6", "7"), "header": False}


@pytest.mark.parametrize(
    "above",
    [
        [",".join(NAMES), "s,m/s2,m/s2,m/s2,rad/s,rad/s,rad/s"],
        ["A log of Tuesday", "rate = 100", ",".join(NAMES)],
        ["%time log v3", "#" + ",".join(NAMES), "float,float,float,float,float,float,float", ""],
        ["# " + ",".join(NAMES)],
        [",".join(NAMES)],
    ],
)
def test_the_line_that_names_the_columns_is_found_among_those_above_the_data(tmp_path, above):
    imu_text(tmp_path, *above)
    recording = Tables(str(tmp_path)).load(0)
    np.testing.assert_allclose(recording.imu.accel_mps2, IMU[:, 1:4], atol=1e-6)
    assert len(recording.imu.t_s) == N


def test_names_above_a_table_that_is_said_to_have_none_are_left_out(tmp_path):
    imu_text(tmp_path, "Sensor 7", ",".join(NAMES), "s,m/s2,m/s2,m/s2,rad/s,rad/s,rad/s")
    recording = Tables(str(tmp_path), **numbered()).load(0)
    np.testing.assert_allclose(recording.imu.gyro_radps, IMU[:, 4:], atol=1e-6)


@pytest.mark.parametrize(
    ("first", "last", "dropped"),
    [
        ("0.1,0.2", "", "the first row is truncated: 1 dropped"),
        (None, "7.0,0.1,9.", "the last row is truncated"),
        (None, "7.0,0.1,0.2,9.8,0,0,-", "the last row is truncated"),
        ("81,0,0,0", "7", "the first and the last rows are truncated: 2 dropped"),
    ],
)
def test_rows_that_were_cut_are_dropped_and_counted(tmp_path, first, last, dropped):
    imu_text(tmp_path, *([first] if first else []), below=last)
    recording = Tables(str(tmp_path), **numbered()).load(0)
    assert len(recording.imu.t_s) == N
    assert [dropped in note for note in recording.notes] == [True]


def test_a_time_alone_that_was_cut_is_dropped_and_counted(tmp_path):
    rows = np.roll(IMU, -1, axis=1)  # the time is the last column
    unix = rows + np.array([0, 0, 0, 0, 0, 0, 1.7e9])
    turned = {"imu_time": "7", "imu_accel": ("1", "2", "3"), "imu_gyro": ("4", "5", "6"), "header": False}
    imu_text(tmp_path, rows=unix)
    text = (tmp_path / "imu.csv").read_text().rstrip("\n")
    (tmp_path / "imu.csv").write_text(text[:-9])  # 17000000
    recording = Tables(str(tmp_path), **turned).load(0)
    assert len(recording.imu.t_s) == N - 1
    (tmp_path / "imu.csv").write_text("\n".join(imu_lines(IMU + np.eye(7)[0] * 1.7e9))[3:])  # its first digits
    recording = Tables(str(tmp_path), **numbered()).load(0)
    assert len(recording.imu.t_s) == N - 1
    assert recording.duration_s == pytest.approx(1.98, abs=1e-5)
    assert "the first row is truncated" in recording.notes[0]


@pytest.mark.parametrize("compressed", [False, True])
def test_whole_logs_lose_nothing(tmp_path, compressed):
    imu_text(tmp_path, ",".join(NAMES), rows=IMU[:3] if compressed else IMU)
    recording = Tables(str(tmp_path)).load(0)
    assert len(recording.imu.t_s) == (3 if compressed else N)
    assert recording.notes == ()


VARIANCE = 0.5 + np.arange(10) / 10


@pytest.mark.parametrize(
    ("given", "columns", "expected"),
    [
        ("position_covariance", {"v": VARIANCE}, lambda v: v * np.eye(3)),
        (
            "position_covariance",
            {"a": VARIANCE, "b": 2 * VARIANCE, "c": 3 * VARIANCE},
            lambda v: v * np.diag([1, 2, 3]),
        ),
        (
            "position_covariance",
            {k: f * VARIANCE for k, f in zip("abcdef", (1, 2, 3, 0.1, 0.2, -0.3), strict=True)},
            lambda v: v * np.array([[1, 0.1, 0.2], [0.1, 2, -0.3], [0.2, -0.3, 3]]),
        ),
        (
            "position_covariance",
            {k: f * VARIANCE for k, f in zip("abcdefghi", (1, 0.1, 0.2, 0.1, 2, -0.3, 0.2, -0.3, 3), strict=True)},
            lambda v: v * np.array([[1, 0.1, 0.2], [0.1, 2, -0.3], [0.2, -0.3, 3]]),
        ),
        (
            "position_sigma",  # RTKLIB: 11 22 33 12 23 31, roots with signs
            {k: f * VARIANCE for k, f in zip("abcdef", (1, 2, 3, 0.5, -0.6, 0.4), strict=True)},
            lambda v: v**2 * np.array([[1, 0.25, 0.16], [0.25, 4, -0.36], [0.16, -0.36, 9]]),
        ),
    ],
)
def test_covariances_come_in_any_number_of_columns(tmp_path, given, columns, expected):
    imu_text(tmp_path, ",".join(NAMES))
    fixes(tmp_path, **columns)
    position = Tables(str(tmp_path), **FIXES, **{given: tuple(columns)}).load(0).position
    np.testing.assert_allclose(position.covariance_m2, [expected(v) for v in VARIANCE], rtol=1e-9)


def test_covariances_in_other_axes_are_turned_and_impossible_ones_keep_their_variances(tmp_path):
    imu_text(tmp_path, ",".join(NAMES))
    six = dict(zip("pqrsxy", (1.0, 2.0, 3.0, 0.1, 0.2, -0.3), strict=True))
    matrix = np.array([[1, 0.1, 0.2], [0.1, 2, -0.3], [0.2, -0.3, 3]])
    fixes(tmp_path, **six, **{k + "v": value for k, value in six.items()})
    given = FIXES | {"position_covariance": tuple("pqrsxy"), "velocity_file": "fix.csv"}
    given |= {"velocity_columns": ("e", "n", "u"), "velocity_covariance": tuple(k + "v" for k in "pqrsxy")}
    ned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    recording = Tables(str(tmp_path), **given, position_covariance_frame="ned", velocity_frame="ned").load(0)
    np.testing.assert_allclose(recording.position.covariance_m2[0], ned @ matrix @ ned.T)
    np.testing.assert_allclose(recording.velocity.covariance_m2ps2[0], ned @ matrix @ ned.T)
    place = Origin(48.0, 11.0, 500.0)
    at = {"origin": (48.0, 11.0, 500.0), "position_covariance_frame": "ecef", "velocity_frame": "ecef"}
    recording = Tables(str(tmp_path), **given, **at).load(0)
    east_north_up = enu_axes(place)
    np.testing.assert_allclose(recording.position.covariance_m2[0], east_north_up @ matrix @ east_north_up.T)
    np.testing.assert_allclose(recording.velocity.mps, PLACES @ east_north_up.T, atol=1e-12)
    with pytest.raises(RecordingError, match="give origin"):
        Tables(str(tmp_path), **given, position_covariance_frame="ecef").load(0)
    imu_text(tmp_path, ",".join(NAMES))
    fixes(tmp_path, a=0.01, b=0.01, c=0.04, d=[0.01] * 3 + [0.0] * 7, x=0.0)
    given = {"position_covariance": ("a", "b", "c", "d", "x", "x")}
    recording = Tables(str(tmp_path), **FIXES, **given).load(0)
    np.testing.assert_allclose(recording.position.covariance_m2, np.tile(np.diag([0.01, 0.01, 0.04]), (10, 1, 1)))
    fault = "fix.csv: 3 of 10 rows have a covariance that is not positive definite"
    assert f"{fault}: only the sizes of their variances are used." in recording.notes


def test_sigmas_and_covariances_at_once_are_refused():
    with pytest.raises(PluginError, match="both given"):
        Tables("here", position_sigma=("a",), position_covariance=("b",))
    with pytest.raises(PluginError, match=r"position_covariance has 2 entries, .*; it must have 0, 1, 3, 6 or 9"):
        Tables("here", position_covariance=("a", "b"))


def matlab_5(path):
    imu = {"t": IMU[:, :1], "acc": IMU[:, 1:4], "gyr": IMU[:, 4:], "name": "a"}
    savemat(path, {"imu": imu, "fix": PLACES, "fix_t": FIX_S, "comment": "a drive", "rate": 100.0})


def matlab_7_3(path):
    """As MATLAB writes it: HDF5 behind 512 bytes of its own, the axes the other way round."""
    with h5py.File(path, "w", userblock_size=512) as file:
        imu = file.create_group("imu")
        for name, values in (("t", IMU[:, :1]), ("acc", IMU[:, 1:4]), ("gyr", IMU[:, 4:])):
            imu.create_dataset(name, data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
        file["fix"], file["fix_t"] = PLACES.T, FIX_S[None]
        file["comment"] = np.frombuffer("a drive".encode("utf-16-le"), dtype=np.uint16)[:, None]
        file["#refs#/a"] = np.zeros((2, 2))
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))


@pytest.mark.parametrize("write", [matlab_5, matlab_7_3])
def test_matlab_files_are_tables(tmp_path, write):
    write(tmp_path / "drive.mat")
    given = {f"{stream}_file": "drive.mat" for stream in ("imu", "position")}
    given |= {"imu_time": "imu.t", "imu_accel": tuple(f"imu.acc_{k}" for k in (1, 2, 3))}
    given |= {"imu_gyro": tuple(f"imu.gyr_{k}" for k in (1, 2, 3)), "position_time": "fix_t"}
    given |= {"position_columns": ("fix_1", "fix_2", "fix_3"), "position_frame": "enu"}
    recording = Tables(str(tmp_path), **given).load(0)
    np.testing.assert_array_equal(recording.imu.accel_mps2, IMU[:, 1:4])
    np.testing.assert_array_equal(recording.imu.gyro_radps, IMU[:, 4:])
    np.testing.assert_allclose(recording.position.t_s, FIX_S - 5.0, atol=1e-9)
    np.testing.assert_array_equal(recording.position.enu_m, PLACES)
    with pytest.raises(RecordingError, match=r"There is no column 'acc'.*imu\.acc_1"):
        Tables(str(tmp_path), **(given | {"imu_accel": ("acc",) * 3})).load(0)


@pytest.mark.parametrize(
    "content", [b"nonsense", b"MATLAB 5.0 MAT-file" + bytes(400), b"\x89HDF\r\n\x1a\n" + bytes(99)]
)
def test_a_damaged_matlab_file_is_a_sentence(tmp_path, content):
    (tmp_path / "imu.mat").write_bytes(content)
    with pytest.raises(RecordingError, match=r"imu\.mat (cannot be read as a MATLAB file|holds no numeric)"):
        Tables(str(tmp_path), imu_file="imu.mat").load(0)
