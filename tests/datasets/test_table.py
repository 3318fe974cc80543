"""One drive on a circle, known in closed form, written in every format that there is a preset for."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pandas as pd
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.datasets.table import Tables
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.writing import write_table
from jerkbench.jobs.names import choose
from jerkbench.plugins import create
from jerkbench.plugins.checks import check_plugin
from jerkbench.plugins.samples import small_recording
from jerkbench.recording import Origin

START_NS = 1_403_636_579_763_555_584
LATITUDE, LONGITUDE, HEIGHT = 49.0, 8.4, 110.0
SQUARE = 1 - 0.00669437999014 * np.sin(np.radians(LATITUDE)) ** 2
NORTH_M_PER_RAD = 6378137.0 * (1 - 0.00669437999014) / SQUARE**1.5 + HEIGHT  # the ellipsoid's radii of curvature
EAST_M_PER_RAD = (6378137.0 / SQUARE**0.5 + HEIGHT) * np.cos(np.radians(LATITUDE))


def circle(t):
    """East, north, up; velocity; yaw; 2 m/s on 5 m, with the body's forward force 0 and its force to the left 0.8."""
    angle = 0.4 * t
    enu = np.column_stack([5 * np.sin(angle), 5 - 5 * np.cos(angle), 0 * t])
    velocity = np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), 0 * t])
    return enu, velocity, np.arctan2(np.sin(angle), np.cos(angle))


IMU_S, FIX_S = np.arange(1000) / 100, np.arange(95) / 10
FORCE, RATE = np.tile([0.0, 0.8, 9.81], (1000, 1)), np.tile([0.0, 0.0, 0.4], (1000, 1))


def stamps_ns(t_s):
    return START_NS + np.round(t_s * 1e9).astype(np.int64)


def geodetic(enu):
    return np.column_stack(
        [
            LATITUDE + np.degrees(enu[:, 1] / NORTH_M_PER_RAD),
            LONGITUDE + np.degrees(enu[:, 0] / EAST_M_PER_RAD),
            HEIGHT + enu[:, 2],
        ]
    )


def write(path, table, **how):
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(table).to_csv(path, **({"index": False} | how))


def euroc(folder):
    """The sensor's x is up, y right, z forward."""
    sensor_from_flu = np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]])
    imu = pd.DataFrame(np.hstack([RATE @ sensor_from_flu.T, FORCE @ sensor_from_flu.T])).add_prefix("c")
    imu.insert(0, "#timestamp [ns]", stamps_ns(IMU_S))
    write(folder / "imu0/data.csv", imu)
    enu, velocity, yaw = circle(FIX_S)
    place = pd.DataFrame(enu, columns=["x", "y", "z"])
    place.insert(0, "#timestamp", stamps_ns(FIX_S))
    write(folder / "leica0/data.csv", place)
    world_from_sensor = Rotation.from_euler("z", yaw[:, None]).as_matrix() @ sensor_from_flu.T
    attitude = Rotation.from_matrix(world_from_sensor).as_quat(scalar_first=True)
    truth = pd.concat([place, pd.DataFrame(np.hstack([attitude, velocity, np.zeros((95, 6))])).add_prefix("c")], axis=1)
    write(folder / "state_groundtruth_estimate0/data.csv", truth)


def tum(folder):
    imu = np.column_stack([IMU_S, RATE, FORCE])
    (folder / "imu.txt").write_text("\n".join(" ".join(map(str, row)) for row in imu))
    enu, _, yaw = circle(FIX_S)
    rows = np.column_stack([FIX_S, enu, Rotation.from_euler("z", yaw[:, None]).as_quat()])
    lines = ["# t x y z qx qy qz qw", *(" ".join(map(str, row)) for row in rows)]
    (folder / "groundtruth.txt").write_text("\n".join(lines))


def kitti(folder):
    """Every row is a file of its own; the OXTS has 30 columns."""
    data = folder / "oxts" / "data"
    data.mkdir(parents=True)
    enu, velocity, yaw = circle(FIX_S)
    table = np.zeros((95, 30))
    table[:, :3], table[:, 5], table[:, 6], table[:, 7] = geodetic(enu), yaw, velocity[:, 1], velocity[:, 0]
    table[:, 14:17], table[:, 20:23], table[:, 23] = FORCE[0], RATE[0], 0.05
    for k, row in enumerate(table):
        (data / f"{k:010d}.txt").write_text(" ".join(map(repr, row.tolist())))
    start = datetime(2011, 9, 26, 13, 2, 25, tzinfo=UTC)
    times = ((start + timedelta(seconds=t)).strftime("%Y-%m-%d %H:%M:%S.%f") + "000" for t in FIX_S)
    (folder / "oxts" / "timestamps.txt").write_text("\n".join(times))


def nclt(folder):
    frd = np.array([1.0, -1.0, -1.0])
    imu = pd.DataFrame(np.hstack([np.zeros((1000, 3)), FORCE * frd, RATE * frd]))
    imu.insert(0, "utime", stamps_ns(IMU_S) // 1000)
    write(folder / "ms25.csv", imu, header=False)
    places = geodetic(circle(FIX_S)[0])
    places[:, :2] = np.radians(places[:, :2])
    gps = pd.DataFrame(np.hstack([np.full((95, 2), 3.0), places, np.zeros((95, 2))]))
    gps.insert(0, "utime", stamps_ns(FIX_S) // 1000)
    write(folder / "gps.csv", gps, header=False)


def urbannav(folder):
    """A SPAN's angles: roll, pitch, heading from north clockwise, of a body whose axes are forward, right, down."""
    frd, week = np.array([1.0, -1.0, -1.0]), 2032
    start = week * 604800 + 200000.0 + 315964800 - 18  # UTC since 1970
    named = [
        f"{what} {axis} ({unit})"
        for what, unit in (("Acceleration", "m/s^2"), ("Angular rate", "rad/s"))
        for axis in "XYZ"
    ]
    imu = pd.DataFrame(np.hstack([FORCE * frd, RATE * frd]), columns=named)
    imu.insert(0, "GPS TOW (s)", 200000 + IMU_S)
    imu.insert(1, " GPS Week", week)
    write(folder / "Odaiba_imu.csv", imu)
    enu, velocity, yaw = circle(FIX_S)
    angles = np.degrees(np.column_stack([0 * yaw, 0 * yaw, np.pi / 2 - yaw]))
    names = ["Latitude (deg)", "Longitude (deg)", "Ellipsoid Height (m)", "Roll (deg)", "Pitch (deg)", "Heading (deg)"]
    reference = pd.DataFrame(np.hstack([geodetic(enu), angles]), columns=names)
    reference[[f"Velocity {axis} (m/s)" for axis in "XYZ"]] = velocity
    reference.insert(0, "GPS TOW (s)", 200000 + FIX_S)
    reference.insert(1, "GPS Week", week)
    write(folder / "Odaiba_reference.csv", reference)
    stamps = [datetime.fromtimestamp(round(start + t, 3), tz=UTC).strftime("%Y/%m/%d %H:%M:%S.%f") for t in FIX_S]
    solution(folder / "rover.pos", "UTC", stamps, geodetic(enu))


def solution(path, clock, stamps, places):
    """As RTKLIB writes it."""
    names = "latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    rows = [
        " ".join([stamp, *(f"{v:.12f}" for v in place), "5 9 2 1 4 0 0 0 0 0"])
        for stamp, place in zip(stamps, places, strict=True)
    ]
    path.write_text("\n".join([f"%  {clock} {names}", *rows]))


def ppc(folder):
    """As published: blanks after the commas, two before the last rates; GPS time of week."""
    frd, week = np.array([1.0, -1.0, -1.0]), 2325
    named = (
        "GPS TOW (s), GPS Week, Acc X (m/s^2), Acc Y (m/s^2), Acc Z (m/s^2), Ang Rate X (deg/s),  Ang Rate Y (deg/s),"
    )
    rows = np.column_stack([200000 + IMU_S, np.full(1000, week), FORCE * frd, np.degrees(RATE) * frd])
    lines = [", ".join([f"{row[0]:.2f}", f"{row[1]:.0f}", *(f"{value:.9f}" for value in row[2:])]) for row in rows]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "imu.csv").write_text("\n".join([f"{named}  Ang Rate Z (deg/s)", *lines]))
    enu, velocity, yaw = circle(FIX_S)
    places = geodetic(enu)
    names = ["GPS TOW (s)", "GPS Week", "Latitude (deg)", "Longitude (deg)", "Ellipsoid Height (m)"]
    names += [f"ECEF {axis} (m)" for axis in "XYZ"] + ["Roll (deg)", "Pitch (deg)", "Heading (deg)"]
    names += [f"{axis} Velocity (m/s)" for axis in ("East", "North", "Up")]
    ecef = np.column_stack(pymap3d.geodetic2ecef(*places.T))
    angles = np.degrees(np.column_stack([0 * yaw, 0 * yaw, np.pi / 2 - yaw]))
    rows = np.column_stack([200000 + FIX_S, np.full(95, week), places, ecef, angles, velocity])
    lines = [", ".join(f"{value:.12g}" for value in row) for row in rows]
    (folder / "reference.csv").write_text("\n".join([", ".join(names), *lines]))
    solution(folder / "rover.pos", "GPST", [f"{week} {200000 + t:.3f}" for t in FIX_S], places)


def other_notes(recording):
    """The notes, but for the one that says that these made-up samples are all alike."""
    return tuple(note for note in recording.notes if "repeat all values" not in note)


def loaded(preset, folder, **changes):
    plain = choose("dataset", {"name": preset, "folder": str(folder), **changes}).plain
    return create("dataset", plain).load(0)


@pytest.mark.parametrize("preset", [euroc, tum, kitti, nclt, urbannav, ppc])
def test_every_preset_gives_the_same_drive(tmp_path, preset):
    preset(tmp_path)
    recording = loaded(preset.__name__, tmp_path)
    enu, velocity, yaw = circle(recording.position.t_s)

    assert len(recording.position.t_s) == 95
    assert recording.imu.t_s[0] == 0
    np.testing.assert_allclose(recording.position.t_s, FIX_S, atol=1e-6)
    np.testing.assert_allclose(recording.position.enu_m, enu, atol=2e-3)
    np.testing.assert_allclose(recording.imu.accel_mps2, FORCE[: len(recording.imu.t_s)], atol=1e-12)
    np.testing.assert_allclose(recording.imu.gyro_radps, RATE[: len(recording.imu.t_s)], atol=1e-12)
    if recording.velocity is not None:
        np.testing.assert_allclose(recording.velocity.mps, velocity, atol=1e-9)
    if recording.reference.euler_rad is not None:
        np.testing.assert_allclose(recording.reference.euler_rad, np.column_stack([0 * yaw, 0 * yaw, yaw]), atol=1e-9)
    np.testing.assert_allclose(recording.reference.enu_m, enu, atol=2e-3)


def test_nanoseconds_stay_exact_and_date_the_start(tmp_path):
    euroc(tmp_path)
    recording = loaded("euroc", tmp_path)
    assert recording.imu.t_s[1] == pytest.approx(0.01, abs=1e-12)
    assert recording.start_utc == datetime.fromtimestamp(START_NS // 10**9, tz=UTC) + timedelta(microseconds=763555)


def test_a_solution_is_of_the_earth_and_takes_an_origin(tmp_path):
    urbannav(tmp_path)
    recording = loaded("urbannav", tmp_path)
    assert recording.start_utc == datetime(2018, 12, 18, 7, 33, 2, tzinfo=UTC)  # week 2032 begins on 16 December
    np.testing.assert_allclose(recording.position.covariance_m2[0], np.diag([1.0, 4.0, 16.0]))
    with pytest.raises(PluginError, match="set epoch to gps"):
        loaded("urbannav", tmp_path, epoch="none")
    with pytest.raises(RecordingError, match="out-outvel=on"):
        loaded("urbannav", tmp_path, velocity_file="rover.pos")
    urbannav(tmp_path)
    with pytest.raises(PluginError, match="geodetic and reference_frame is enu"):
        loaded("urbannav", tmp_path, reference_frame="enu")
    south = np.array([LATITUDE, LONGITUDE, HEIGHT]) - [np.degrees(1000 / NORTH_M_PER_RAD), 0, 0]
    recording = loaded("urbannav", tmp_path, origin=south.tolist())
    expected = np.column_stack(pymap3d.geodetic2enu(*geodetic(circle(FIX_S)[0]).T, *south))
    np.testing.assert_allclose(recording.position.enu_m, expected, atol=1e-5)
    np.testing.assert_allclose(recording.reference.enu_m, expected, atol=1e-5)


def test_a_solution_beside_times_of_unix(tmp_path):
    """RTKLIB's velocities too; GPS time is 18 s ahead."""
    from jerkbench.io.tracks import _POS_HEADER

    start = datetime(2025, 7, 8, 19, 34, 18, tzinfo=UTC)
    write(tmp_path / "imu.csv", PLAIN | {"t": start.timestamp() + IMU_S})
    rows = [f"% {_POS_HEADER}"]
    for k in range(8):
        stamp = (start + timedelta(seconds=18 + k)).strftime("%Y/%m/%d %H:%M:%S.%f")
        rows.append(f"{stamp} 49 8.4 110 1 9 .01 .01 .02 0 0 0 0 0 1.5 -2.5 0.25 .1 .2 .3 0 0 0")
    (tmp_path / "a.pos").write_text("\n".join(rows))
    solved = {"position_file": "a.pos", "velocity_file": "a.pos", "velocity_shift_s": -0.1, "position_shift_s": 0.2}
    recording = Tables(str(tmp_path), **solved).load(0)
    np.testing.assert_allclose(recording.position.t_s, np.arange(8) + 0.2, atol=1e-6)
    np.testing.assert_allclose(recording.velocity.t_s, np.arange(8) - 0.1, atol=1e-6)
    np.testing.assert_allclose(recording.velocity.mps[3], [-2.5, 1.5, 0.25])
    np.testing.assert_allclose(recording.velocity.covariance_m2ps2[0], np.diag([0.04, 0.01, 0.09]))


@pytest.mark.parametrize("name", ["all.csv", "all.parquet"])
def test_one_table_of_all_streams_is_read_back(tmp_path, name):
    """What `data convert` writes: a row for each stamp of any stream, empty where a stream has none."""
    small = small_recording()
    write_table(small, tmp_path / name)
    enu, axes = ("east_m", "north_m", "up_m"), ("forward", "left", "up")
    files = {
        f"{stream}_{what}": value
        for stream in ("imu", "position", "velocity", "reference")
        for what, value in (("file", name), ("time", "t_s"))
    }
    back = Tables(
        str(tmp_path),
        **files,
        epoch="none",
        imu_accel=tuple(f"accel_{axis}_mps2" for axis in axes),
        imu_gyro=tuple(f"gyro_{axis}_radps" for axis in axes),
        position_columns=tuple(f"position_{axis}" for axis in enu),
        position_frame="enu",
        velocity_columns=tuple(f"velocity_{axis.replace('_m', '_mps')}" for axis in enu),
        reference_position=tuple(f"reference_{axis}" for axis in enu),
        reference_attitude=tuple(f"reference_{angle}_rad" for angle in ("roll", "pitch", "yaw")),
    ).load(0)
    zero_s = small.imu.t_s[0]
    for stream, field in (
        ("imu", "accel_mps2"),
        ("position", "enu_m"),
        ("velocity", "mps"),
        ("reference", "euler_rad"),
    ):
        one, other = getattr(back, stream), getattr(small, stream)
        np.testing.assert_allclose(one.t_s, other.t_s - zero_s, atol=1e-9)
        np.testing.assert_allclose(getattr(one, field), getattr(other, field), atol=1e-9)


def test_a_row_keeps_its_number_where_others_are_left_out(tmp_path):
    table = pd.DataFrame({"t": np.arange(8.0), **dict.fromkeys(("ax", "ay", "az", "gx", "gy"), 0.0)})
    table["gz"] = ["", "1", "", "2", "x", "3", "4", "5"]
    table.loc[[0, 2], ["ax", "ay", "az", "gx", "gy"]] = np.nan
    table.to_csv(tmp_path / "imu.csv", index=False)
    with pytest.raises(RecordingError, match=r"row 5, column gz: 'x' is not a number"):
        Tables(str(tmp_path)).load(0)
    table.assign(hx=np.nan, hy=np.nan, hz=np.nan).to_csv(tmp_path / "imu.csv", index=False)
    with pytest.raises(RecordingError, match="hx, hy, hz"):
        Tables(str(tmp_path), position_file="imu.csv", position_columns=("hx", "hy", "hz")).load(0)


PLAIN = {"t": IMU_S, "ax": 0 * IMU_S, "ay": 0 * IMU_S, "az": 0 * IMU_S + 1, "gx": 0 * IMU_S, "gy": 0 * IMU_S}
PLAIN["gz"] = 0 * IMU_S + 90
GIVEN = {"accel_unit": "g", "gyro_unit": "deg/s", "epoch": "none"}


def test_units_axes_shifts_and_parquet(tmp_path):
    pd.DataFrame(PLAIN).to_parquet(tmp_path / "imu.parquet")
    enu, _, _ = circle(FIX_S)
    fixes = pd.DataFrame({"t": FIX_S, "n": enu[:, 1], "e": enu[:, 0], "d": 0 * FIX_S, "s": 0 * FIX_S + 0.3})
    fixes.loc[3, "d"] = np.nan
    fixes.to_csv(tmp_path / "fix.csv", index=False)
    speeds = pd.DataFrame({"t": FIX_S, "v": 2.0})
    speeds.to_csv(tmp_path / "wheel.csv", index=False)
    dataset = Tables(
        str(tmp_path),
        **GIVEN,
        imu_file="imu.parquet",
        imu_axes=("-x", "-y", "z"),
        position_file="fix.csv",
        position_columns=("n", "e", "d"),
        position_frame="ned",
        position_sigma=("s",),
        position_shift_s=-0.05,
        velocity_file="wheel.csv",
        velocity_columns=("v",),
        velocity_frame="speed",
    )
    recording = dataset.load(0)

    np.testing.assert_allclose(recording.imu.accel_mps2[0], [0, 0, 9.80665])
    np.testing.assert_allclose(recording.imu.gyro_radps[0], [0, 0, np.pi / 2])
    np.testing.assert_allclose(recording.position.t_s, FIX_S - 0.05, atol=1e-9)
    np.testing.assert_allclose(recording.position.enu_m[:, :2], enu[:, :2])
    assert np.isnan(recording.position.enu_m[3, 2])
    np.testing.assert_allclose(recording.position.covariance_m2[0], 0.09 * np.eye(3))
    assert (recording.velocity.frame, recording.velocity.mps[0, 0], recording.start_utc) == ("speed", 2.0, None)
    check_plugin("dataset", dataset)


def test_wrong_values_are_named_and_a_damaged_sample_is_dropped(tmp_path):
    write(tmp_path / "imu.csv", PLAIN | {"az": np.where(np.arange(1000) >= 6, 9e5, 1.0)})
    with pytest.raises(RecordingError, match=r"imu\.csv, specific force, row 7"):
        Tables(str(tmp_path), **GIVEN).load(0)
    write(tmp_path / "imu.csv", PLAIN | {"az": np.where(np.arange(1000) == 6, -9999.0, 1.0)})
    recording = Tables(str(tmp_path), **GIVEN).load(0)
    assert len(recording.imu.t_s) == 999
    assert any(note.startswith("imu.csv: 1 of 1000 rows have a specific force beyond") for note in recording.notes)
    write(tmp_path / "imu.csv", PLAIN | {"ay": ["x" if k == 7 else 0.0 for k in range(1000)]})
    with pytest.raises(RecordingError, match="row 8, column ay"):
        Tables(str(tmp_path)).load(0)
    write(tmp_path / "imu.csv", PLAIN | {"t": [np.nan if k == 7 else float(k) for k in range(1000)]})
    with pytest.raises(RecordingError, match="row 8, column t: 'nan' is not a time in s"):
        Tables(str(tmp_path)).load(0)


@pytest.mark.parametrize("every", [2, 5])
def test_fixes_without_a_height_do_not_leap(tmp_path, every):
    write(tmp_path / "imu.csv", PLAIN)
    fixes = pd.DataFrame(circle(FIX_S)[0] + [0, 0, 110], columns=["e", "n", "u"]).assign(t=FIX_S)
    fixes.loc[np.arange(95) % every > 0, "u"] = np.nan
    fixes.to_csv(tmp_path / "fix.csv", index=False)
    local = {"position_columns": ("e", "n", "u"), "position_frame": "enu"}
    recording = Tables(str(tmp_path), **GIVEN, position_file="fix.csv", **local).load(0)
    assert other_notes(recording) == ()
    np.testing.assert_allclose(recording.position.enu_m, fixes[["e", "n", "u"]])


def geodetic_fixes(folder, change=lambda fixes: None, **more):
    """Fixes at 50 m/s to the east, from 110 to 204 m high, which ``change`` may damage; and where they really were."""
    write(folder / "imu.csv", PLAIN)
    enu = np.outer(FIX_S, [50.0, 5.0, 0.0])
    places = np.column_stack(pymap3d.enu2geodetic(*enu.T, LATITUDE, LONGITUDE, HEIGHT))
    places[:, 2] = HEIGHT + np.arange(95)
    fixes = pd.DataFrame(places, columns=["latitude", "longitude", "height"]).assign(t=FIX_S)
    change(fixes)
    fixes.to_csv(folder / "fix.csv", index=False)
    return places, Tables(str(folder), **GIVEN, position_file="fix.csv", **more)


def test_latitude_and_longitude_without_a_height_are_a_place_in_the_plane(tmp_path):
    def hide(fixes):
        fixes.loc[np.arange(95) % 5 > 0, "height"] = np.nan

    places, table = geodetic_fixes(tmp_path, hide)
    position, seen = table.load(0).position, np.arange(95) % 5 == 0
    assert len(position.t_s) == 95
    expected = np.column_stack(pymap3d.geodetic2enu(*places.T, *places[0]))
    np.testing.assert_allclose(position.enu_m[:, :2], expected[:, :2], atol=1e-3)
    np.testing.assert_allclose(position.enu_m[seen, 2], expected[seen, 2], atol=1e-6)
    assert np.isnan(position.enu_m[~seen, 2]).all()


@pytest.mark.parametrize("frame", ["geodetic", "ecef"])
@pytest.mark.parametrize("leap", [(1.0, 0.0, 0.0), (-95.0, 180.0, 0.0), (0.0, 0.0, 9e3)])
def test_a_first_fix_that_leaps_is_not_the_origin(tmp_path, frame, leap):
    """One degree off, on the other side of the Earth, or high above it: ENU begins at the second."""

    def hurt(fixes):
        names = ["latitude", "longitude", "height"]
        fixes.loc[0, names] += list(leap)
        fixes.loc[60, "longitude"] += 1
        if frame == "ecef":
            fixes[names] = np.column_stack(pymap3d.geodetic2ecef(*fixes[names].to_numpy().T))

    places, table = geodetic_fixes(tmp_path, hurt, position_frame=frame)
    recording = table.load(0)
    kept = np.delete(places, [0, 60], axis=0)
    here = recording.origin
    np.testing.assert_allclose((here.latitude_deg, here.longitude_deg, here.height_m), kept[0], atol=1e-6)
    expected = np.column_stack(pymap3d.geodetic2enu(*kept.T, *kept[0]))
    np.testing.assert_allclose(recording.position.enu_m, expected, atol=1e-5)
    np.testing.assert_array_equal(recording.reference.enu_m, recording.position.enu_m)
    assert other_notes(recording) == (
        "fix.csv: 2 of 95 rows have a position more than 50 m from its neighbours: dropped.",
    )


def test_a_pattern_of_solutions_reads_all_files_but_marks_of_events(tmp_path):
    urbannav(tmp_path)
    whole = loaded("urbannav", tmp_path)
    (tmp_path / "rover_events.pos").write_text((tmp_path / "rover.pos").read_text())
    np.testing.assert_array_equal(loaded("urbannav", tmp_path).position.enu_m, whole.position.enu_m)
    named = loaded("urbannav", tmp_path, position_file="rover_events.pos")
    np.testing.assert_array_equal(named.position.enu_m, whole.position.enu_m)
    (tmp_path / "rover_events.pos").unlink()
    head, *rows = (tmp_path / "rover.pos").read_text().splitlines()
    for name, part in (("rover.pos", rows[:40]), ("rover_2.pos", rows[40:])):
        (tmp_path / name).write_text("\n".join([head, *part]))
    both = loaded("urbannav", tmp_path, position_file="rover*.pos")
    np.testing.assert_allclose(both.position.t_s, whole.position.t_s)
    np.testing.assert_allclose(both.position.enu_m, whole.position.enu_m)
    assert len(loaded("urbannav", tmp_path, position_file="rover.pos").position.t_s) == 40
    (tmp_path / "a.pos").write_text("\n".join([head, *rows]))
    with pytest.raises(RecordingError, match=r"85 of 190 rows are more than 1 s older"):
        loaded("urbannav", tmp_path)


def test_files_of_a_pattern_with_other_columns_are_refused(tmp_path):
    """As many columns, but another name: joined by their names, half of both would be empty."""
    first, second = pd.DataFrame(PLAIN).iloc[:500], pd.DataFrame(PLAIN).iloc[500:]
    first.to_csv(tmp_path / "imu_1.csv", index=False)
    second[second.columns[::-1]].to_csv(tmp_path / "imu_2.csv", index=False)  # another order is none the worse
    table = Tables(str(tmp_path), **GIVEN, imu_file="imu_*.csv")
    np.testing.assert_allclose(table.load(0).imu.t_s, IMU_S, atol=1e-9)
    second.rename(columns={"gz": "rate_z"}).to_csv(tmp_path / "imu_2.csv", index=False)
    with pytest.raises(RecordingError, match=r"imu_2\.csv .*gz"):
        table.load(0)


def local_and_geodetic(folder, fixes="enu", reference="geodetic"):
    """Fixes and reference of the circle, about a local zero 30 m east and 40 m north of which the circle begins."""
    write(folder / "imu.csv", PLAIN)
    enu = circle(FIX_S)[0] + [30, 40, 2]
    tables = {
        "enu": enu,
        "ned": enu[:, [1, 0, 2]] * [1, 1, -1],
        "geodetic": np.column_stack(pymap3d.enu2geodetic(*enu.T, LATITUDE, LONGITUDE, HEIGHT)),
        "ecef": np.column_stack(pymap3d.enu2ecef(*enu.T, LATITUDE, LONGITUDE, HEIGHT)),
    }
    for name, frame in (("fix.csv", fixes), ("truth.csv", reference)):
        pd.DataFrame(tables[frame], columns=["a", "b", "c"]).assign(t=FIX_S).to_csv(folder / name, index=False)
    columns = {"position_columns": ("a", "b", "c"), "reference_position": ("a", "b", "c")}
    files = {"position_file": "fix.csv", "reference_file": "truth.csv"}
    return enu, {"position_frame": fixes, "reference_frame": reference} | columns | files | GIVEN


MIXED = [("enu", "geodetic"), ("ned", "ecef"), ("geodetic", "enu"), ("ecef", "ned")]


@pytest.mark.parametrize(("fixes", "reference"), MIXED)
def test_a_local_frame_beside_one_of_the_earth_needs_an_origin(tmp_path, fixes, reference):
    enu, given = local_and_geodetic(tmp_path, fixes, reference)
    said = rf"position_frame is {fixes} and reference_frame is {reference}.*Give origin"
    with pytest.raises(PluginError, match=said):
        Tables(str(tmp_path), **given)
    recording = Tables(str(tmp_path), **given, origin=(LATITUDE, LONGITUDE, HEIGHT)).load(0)
    np.testing.assert_allclose(recording.position.enu_m, enu, atol=1e-6)
    np.testing.assert_allclose(recording.reference.enu_m, enu, atol=1e-6)
    assert recording.origin == Origin(LATITUDE, LONGITUDE, HEIGHT)


def test_frames_of_one_kind_need_no_origin_but_may_have_one(tmp_path):
    enu, given = local_and_geodetic(tmp_path, "enu", "ned")
    recording = Tables(str(tmp_path), **given).load(0)
    np.testing.assert_allclose(recording.reference.enu_m, recording.position.enu_m)
    assert recording.origin is None
    enu, given = local_and_geodetic(tmp_path, "geodetic", "ecef")
    about_first = Tables(str(tmp_path), **given).load(0)
    np.testing.assert_allclose(about_first.position.enu_m[0], 0, atol=1e-9)
    np.testing.assert_allclose(about_first.reference.enu_m, about_first.position.enu_m, atol=1e-6)
    recording = Tables(str(tmp_path), **given, origin=(LATITUDE, LONGITUDE, HEIGHT)).load(0)
    np.testing.assert_allclose(recording.position.enu_m, enu, atol=1e-6)
    np.testing.assert_allclose(recording.reference.enu_m, enu, atol=1e-6)


def test_a_reference_of_angles_alone_needs_no_origin(tmp_path):
    write(tmp_path / "imu.csv", PLAIN)
    enu = circle(FIX_S)[0]
    fixes = pd.DataFrame(enu, columns=["e", "n", "u"]).assign(t=FIX_S, roll=0.1, pitch=0.2, yaw=0.3)
    fixes.to_csv(tmp_path / "fix.csv", index=False)
    files = {"position_file": "fix.csv", "position_columns": ("e", "n", "u"), "position_frame": "enu"}
    angles = {"reference_file": "fix.csv", "reference_attitude": ("roll", "pitch", "yaw")}
    recording = Tables(str(tmp_path), **GIVEN, **files, **angles, reference_frame="geodetic").load(0)
    assert recording.reference.enu_m is None
    np.testing.assert_allclose(recording.reference.euler_rad[0], [0.1, 0.2, 0.3])


def test_gravity_on_another_axis_is_a_note_and_a_changed_row_changes_the_fingerprint(tmp_path):
    write(tmp_path / "imu.csv", PLAIN)
    turned = Tables(str(tmp_path), **GIVEN, imu_axes=("z", "-y", "x")).load(0)
    assert "has gravity on +x, but a body (forward, left, up) has it on +z" in turned.notes[0]
    assert other_notes(Tables(str(tmp_path), **GIVEN).load(0)) == ()
    write(tmp_path / "imu.csv", PLAIN)
    before = Tables(str(tmp_path)).fingerprint()
    with (tmp_path / "imu.csv").open("a") as file:
        file.write("10,0,0,1,0,0,90\n")
    assert Tables(str(tmp_path)).fingerprint() != before


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"imu_accel": ("ax", "ay", "a")}, "no column 'a'.*Did you mean 'az'"),
        ({"imu_time": "9"}, "no column '9'"),
        ({"imu_file": "gone.csv"}, "There is no file .*gone.csv; correct 'imu_file'"),
        ({"imu_file": "../imu.csv/"}, "imu_file|There is no file"),
        ({"imu_time": ""}, "no file|time_file"),
        ({"position_file": "imu.csv", "position_time": "t"}, "no column 'latitude'"),
    ],
)
def test_what_does_not_fit_is_a_sentence(tmp_path, changes, said):
    write(tmp_path / "imu.csv", PLAIN)
    with pytest.raises(RecordingError, match=said):
        Tables(str(tmp_path), **changes).load(0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"imu_axes": ("x", "y", "-z")}, "imu_axes is .*, which is left-handed; check the signs"),
        ({"imu_axes": ("x", "y", "up")}, "give three sensor axes"),
        ({"imu_accel": ("a",)}, "imu_accel has 1 entries, .*; it must have 3"),
        ({"position_frame": "utm"}, "no position_frame 'utm'"),
        ({"time_unit": "minutes"}, "no time_unit 'minutes'"),
        ({"velocity_frame": "speed"}, "velocity_columns has 3 entries, .*; it must have 1"),
        ({"position_sigma_m": 0.0}, "position_sigma_m"),
        ({"origin": (49.0, 8.4)}, r"origin is \(49.0, 8.4\); give latitude \[deg\], longitude \[deg\] and height"),
        ({"origin": (8.4, 490.0, 110.0)}, r"origin is \(8.4, 490.0, 110.0\), which is not on Earth"),
        ({"origin": (float("nan"), 8.4, 110.0)}, r"which is not on Earth"),
    ],
)
def test_parameters_are_checked(changes, said):
    with pytest.raises(PluginError, match=said):
        Tables("somewhere", **changes)
