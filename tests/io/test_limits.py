"""Limits of all readers: places, dates, sizes of files, and singular covariances."""

import math
import resource
from functools import reduce

import h5py
import numpy as np
import pandas as pd
import pymap3d
import pytest
from scipy.io import savemat

from commands import SHORT, verb
from jerkbench.arrays import positive_definite
from jerkbench.datasets.broad import Broad
from jerkbench.datasets.rosbag import RosBag
from jerkbench.datasets.rtklib import read_time_tag
from jerkbench.datasets.table import Tables
from jerkbench.errors import PluginError, RecordingError
from jerkbench.inspection.evidence import common_edges
from jerkbench.inspection.facts import facts_text
from jerkbench.inspection.guesses import guess_time_unit
from jerkbench.inspection.receiver import receiver_errors
from jerkbench.io.columns import TextFormat
from jerkbench.io.readers import read_columns
from jerkbench.io.sanitiser import off_earth
from jerkbench.io.tracks import _POS_HEADER
from jerkbench.jobs.job import reason_of
from jerkbench.recording import Imu, Position, Recording, Reference

ROWS, START = 6, 1_715_688_000  # 2024-05-14 12:00:00 UTC
WILD = 3
PLACES = {"latitude": (48.0, 1e9), "longitude": (11.5, -361.0), "height": (545.0, 1e5)}
DATES = {"early": 1_000.0, "late": 4_102_444_800.0}  # 1970-01-01 00:16:40, 2100-01-01


def rows_of(fault):
    """Times and places, of which row `WILD` has the fault."""
    table = pd.DataFrame({"t": START + np.arange(ROWS), **{name: whole for name, (whole, _) in PLACES.items()}})
    table = table.astype(np.float64)
    table.loc[WILD, fault if fault in PLACES else "t"] = PLACES[fault][1] if fault in PLACES else DATES[fault]
    return table


def stamp(t):
    return np.datetime_as_string(np.datetime64(int(t), "s"))


def dms(degrees):
    whole = int(abs(degrees))
    return f"{100 * whole + 60 * (abs(degrees) - whole):.4f}", "SW"[0] if degrees < 0 else "N"


def nmea_line(body):
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}\n"


def nmea(folder, table):
    lines = []
    for t, lat, lon, height in table.to_numpy():
        time, date = stamp(t)[11:].replace(":", ""), stamp(t)[2:10].split("-")
        place = f"{dms(lat)[0]},N,{dms(lon)[0]},E"
        lines += [
            f"GPRMC,{time},A,{place},0,0,{date[2]}{date[1]}{date[0]},,",
            f"GPGGA,{time},{place},1,8,1,{height},M,,M,,",
        ]
    (folder / "a.txt").write_text("".join(map(nmea_line, lines)))


def gpx(folder, table):
    points = [
        f'<trkpt lat="{lat}" lon="{lon}"><ele>{height}</ele><time>{stamp(t)}Z</time></trkpt>'
        for t, lat, lon, height in table.to_numpy()
    ]
    (folder / "a.txt").write_text(f"<gpx><trk>{''.join(points)}</trk></gpx>")


def rtklib(folder, table):
    """RTKLIB's times are in GPS time here, 18 s ahead."""
    rest = "1 9 .1 .1 .1 0 0 0 0 0" + 6 * " .1" + 3 * " 0"
    rows = [
        f"{stamp(t + 18).replace('-', '/').replace('T', ' ')}.000 {lat} {lon} {height} {rest}"
        for t, lat, lon, height in table.to_numpy()
    ]
    (folder / "a.pos").write_text("\n".join([f"% {_POS_HEADER}", *rows, ""]))
    return {"position_file": "a.pos"}


def csv(folder, table):
    table.to_csv(folder / "a.txt", index=False)


def parquet(folder, table):
    table.assign(t=pd.to_datetime(table["t"], unit="s", utc=True)).to_parquet(folder / "a.parquet")
    return {"position_file": "a.parquet"}


def matlab(folder, table):
    savemat(folder / "a.mat", {name: table[name].to_numpy() for name in table})
    return {"position_file": "a.mat"}


def hdf5(folder, table):
    with h5py.File(folder / "a.mat", "w") as file:
        for name in table:
            file[name] = table[name].to_numpy()
    return {"position_file": "a.mat"}


def ecef(folder, table):
    places = np.column_stack(pymap3d.geodetic2ecef(*table[[*PLACES]].to_numpy().T))
    table.assign(**dict(zip(PLACES, places.T, strict=True))).to_csv(folder / "a.txt", index=False)
    return {"position_frame": "ecef"}


READERS = (csv, parquet, matlab, hdf5, gpx, nmea, rtklib)
DATED = [reader for reader in READERS if reader not in (rtklib, nmea)]
"""Times of RTKLIB have to increase, which says the same in other words; NMEA's two digits are 2000 to 2099."""
CASES = [(write, fault) for write in READERS for fault in PLACES] + [(ecef, "height")]
CASES += [(write, fault) for write in DATED for fault in DATES]


@pytest.mark.parametrize(("write", "fault"), CASES)
def test_an_impossible_row_is_dropped_and_counted_by_every_reader(tmp_path, write, fault):
    parameters = {"position_file": "a.txt"} | (write(tmp_path, rows_of(fault)) or {})
    recording = Tables(str(tmp_path), imu_file="", **parameters).load(0)

    np.testing.assert_allclose(recording.position.t_s, np.delete(np.arange(ROWS), WILD), atol=1e-6)
    np.testing.assert_allclose(recording.position.enu_m, 0.0, atol=1e-6)
    assert recording.start_utc.timestamp() == START
    what = "a position that is not on Earth" if fault in PLACES else "a date that is not between 1980 and 2100"
    (note,) = [note for note in recording.notes if what in note]
    assert f"1 of {ROWS} rows" in note


@pytest.mark.parametrize("write", READERS)
def test_a_file_without_a_possible_row_is_refused(tmp_path, write):
    parameters = {"position_file": "a.txt"} | (write(tmp_path, rows_of("latitude").assign(latitude=1e9)) or {})
    with pytest.raises(RecordingError, match=rf"all {ROWS} rows have a position that is not on Earth"):
        Tables(str(tmp_path), imu_file="", **parameters).load(0)


def test_a_reference_and_a_time_tag_are_checked_too_and_what_was_not_measured_is_no_fault(tmp_path):
    csv(tmp_path, rows_of("longitude"))
    names = tuple(PLACES)
    table = Tables(str(tmp_path), imu_file="", position_file="a.txt", reference_file="a.txt", reference_position=names,
                   reference_frame="geodetic")  # fmt: skip
    assert len(table.load(0).reference.t_s) == ROWS - 1
    path = tmp_path / "a.tag"
    path.write_bytes(b"TIMETAG RTKLIB".ljust(60, b"\0") + bytes(4) + (5).to_bytes(4, "little") + bytes(8) + b"\x01" * 8)
    with pytest.raises(RecordingError, match="a date that is not between 1980 and 2100"):
        read_time_tag(path)
    places = np.array([[48.0, 11.5, np.nan], [np.nan, 11.5, 1e6], [-90.0, 360.0, -1000.0]])
    np.testing.assert_array_equal(off_earth(places, "geodetic"), [False, True, False])


@pytest.mark.parametrize("origin", [(91.0, 0.0, 0.0), (0.0, 361.0, 0.0), (0.0, 0.0, -2e3), (math.nan, 0.0, 0.0)])
@pytest.mark.parametrize("made", [lambda o: Tables("x", origin=o), lambda o: RosBag("x", origin=o)])
def test_an_origin_off_the_earth_is_refused(made, origin):
    with pytest.raises(PluginError, match="is not on Earth"):
        made(origin)


def test_a_table_with_only_a_header_is_refused(tmp_path, typed):
    (tmp_path / "a.csv").write_text("t,lat,lon,height,ax,ay,az,gx,gy,gz\n")

    done = typed("data", "inspect", "a.csv")

    assert done.returncode == 2
    assert "a.csv has no rows of data; it needs one line for each time stamp." in done.stderr


def test_quaternions_of_zeros_are_no_attitude(tmp_path):
    n = 50
    with h5py.File(tmp_path / "01_x.hdf5", "w") as file:
        file["imu_acc"], file["imu_gyr"] = np.tile([0.0, 0.0, 9.81], (n, 1)), np.zeros((n, 3))
        file["opt_quat"], file["movement"] = np.zeros((n, 4)), np.ones(n)
        file.attrs["sampling_rate"] = 100.0
    with pytest.raises(RecordingError, match="01_x has no optical attitude"):
        Broad(str(tmp_path), 1, remove_gyro_bias=False).load()


# A clock that was set under way: the time span is years, and the rows are few.


def test_a_clock_that_was_set_under_way_is_named_and_needs_no_memory():
    t_s = np.concatenate([np.arange(200) / 100, 1.7e9 + np.arange(200) / 100])
    enu_m = np.column_stack([np.arange(400.0), np.zeros((400, 2))])
    imu = Imu(t_s, np.tile([0.1, 0.0, 9.81], (400, 1)), np.full((400, 3), 0.01))
    truth = Reference(t_s, "x", independent=True, enu_m=enu_m + 0.1, euler_rad=np.zeros((400, 3)))
    fixes = Position(t_s, enu_m + np.random.default_rng(0).normal(0, 0.1, (400, 3)), np.tile(np.eye(3), (400, 1, 1)))
    recording = Recording("x", imu, truth, fixes)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "the IMU has 1 gap of up to 16999999" in facts_text(recording)
    errors = receiver_errors(recording)
    assert not len(errors.lags_s)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000
    assert len(common_edges(0.5, np.concatenate([np.arange(100_000) / 100, 3e5 + np.arange(100_000) / 100]))) > 600_000
    for stamps in (np.zeros(5), np.zeros(0)):
        guess = guess_time_unit(stamps, "")
        assert (guess.value, guess.grade) == ("s", "unsure")


# Fields of tracks that are of another kind than they should be.


GGA, RMC = "GPGGA,12{:04d},{},N,01131.0,E,1,8,1,5,M,,M,,", "GPRMC,12{:04d},A,4807.0,N,01131.0,E,0,0,{},,"


@pytest.mark.parametrize(
    ("lines", "dropped"),
    [
        ([RMC.format(5, "999999")], "1 sentences have no valid time or date"),
        ([RMC.format(5, "000000"), "GPZDA,120006,01,01,99999999999,00,00"], "2 sentences have no valid time or date"),
        ([RMC.format(9999, "140524")], "1 sentences have no valid time or date"),
        ([GGA.format(5, "9" * 60_000)], "1 of 4 reports have no fix"),
        ([GGA.format(5, "9" * 20)], "1 of 4 rows have a position that is not on Earth"),
    ],
)
def test_a_damaged_sentence_is_dropped_and_counted(tmp_path, lines, dropped):
    whole = [RMC.format(k, "140524") for k in range(3)]
    (tmp_path / "a.txt").write_text("".join(map(nmea_line, [*whole, *lines])))
    recording = Tables(str(tmp_path), imu_file="", position_file="a.txt").load(0)

    assert len(recording.position.t_s) == 3
    assert dropped in " ".join(recording.notes)


def test_an_imu_table_beside_a_solution_is_dated(tmp_path):
    rtklib(tmp_path, rows_of("latitude"))
    t = START + np.arange(0, ROWS, 0.01)
    t[7] = 5e9
    imu = pd.DataFrame({"t": t, "ax": 0.0, "ay": 0.0, "az": 1.0, "gx": 0.0, "gy": 0.0, "gz": 0.0})
    imu.to_csv(tmp_path / "a.csv", index=False)
    recording = Tables(str(tmp_path), imu_file="a.csv", position_file="a.pos", accel_unit="g").load()

    assert len(recording.inertial.t_s) == len(t) - 1
    assert any("1 of 600 rows have a date" in note for note in recording.notes)


AXES = np.random.default_rng(0).normal(0, 0.5, (1000, 3))
RANK_ONE = AXES[:, :, None] * AXES[:, None, :]
TABLE = (
    *("dataset=table", "dataset.folder=.", "dataset.position_file=fix.csv", "dataset.position_time=t"),
    *("dataset.position_columns=[e,n,u]", "dataset.position_frame=enu", "dataset.epoch=none", "dataset.imu_file=''"),
    *("dataset.position_covariance=[a,b,c,d,e1,f,g,h,i]", "filter=constant_velocity", "disturbance=withhold"),
)


def test_a_matrix_of_rank_one_or_two_is_not_definite_and_a_singular_one_in_a_run_a_sentence():
    rank_two = RANK_ONE + RANK_ONE[::-1]
    assert not positive_definite(np.concatenate([RANK_ONE, rank_two, 1e8 * RANK_ONE, np.full((1, 3, 3), np.nan)])).any()
    assert positive_definite(RANK_ONE + 1e-6 * np.eye(3)).all()
    with pytest.raises(np.linalg.LinAlgError) as caught:
        np.linalg.inv(np.zeros((2, 2)))
    assert "check the covariances" in reason_of(caught.value)
    assert "line" not in reason_of(caught.value)


def recorded(folder, covariances):
    rng = np.random.default_rng(1)
    rows = (
        ",".join(f"{x:.17g}" for x in (0.2 * k, 0.6 * k, 0.4 * k, rng.normal(), *C.ravel()))
        for k, C in enumerate(covariances)
    )
    (folder / "fix.csv").write_text("t,e,n,u,a,b,c,d,e1,f,g,h,i\n" + "\n".join(rows) + "\n")


def test_rank_one_in_a_table_is_counted_and_its_variances_are_used(tmp_path):
    recorded(tmp_path, RANK_ONE[:200])
    done = verb("run", *SHORT[1:], *TABLE, "adaptation=student_t_r", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "fix.csv: 200 of 200 rows have a covariance that is not positive definite" in " ".join(done.stdout.split())


@pytest.mark.parametrize("variance", [5e-324, 1e-300, 0.0])
def test_variances_that_are_practically_zero_are_one_message(tmp_path, variance):
    recorded(tmp_path, np.tile(variance * np.eye(3), (200, 1, 1)))
    done = verb("run", *SHORT[1:], *TABLE, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    none = "none of the 200 rows has a standard deviation above 0"
    assert ("the covariance is not positive definite" if variance else none) in done.stderr


def test_stamps_of_matlab_files_are_exact(tmp_path):
    savemat(tmp_path / "a.mat", {"t": np.array([1, 2**53 + 1], np.uint64)})

    assert read_columns((tmp_path / "a.mat",), TextFormat()).stamps_ns("t", "ns").tolist() == [1, 2**53 + 1]


def test_a_number_of_400_digits_is_named(tmp_path):
    (tmp_path / "a.csv").write_text("t,x\n0,1\n1,2\n2," + "9" * 400 + "\n")
    columns = read_columns((tmp_path / "a.csv",), TextFormat())

    with pytest.raises(RecordingError, match="column x has a number that is too large"):
        columns.numbers(["x"])


def linked(file):
    layout = h5py.VirtualLayout((9, 3), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "imu_acc", shape=(9, 3))
    file.create_virtual_dataset("imu_acc", layout)


@pytest.mark.parametrize(
    ("name", "read"),
    [("a.mat", lambda p: read_columns((p,), TextFormat())), ("01_x.hdf5", lambda p: Broad(str(p.parent), 1).load())],
)
def test_values_in_another_file_are_not_read_as_zeros(tmp_path, name, read):
    with h5py.File(tmp_path / name, "w") as file:
        linked(file)

    with pytest.raises(RecordingError, match="imu_acc refers to another file"):
        read(tmp_path / name)
