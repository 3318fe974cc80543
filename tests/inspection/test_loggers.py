"""The same drive as common loggers write it: names, units, times and files that they use, and what they repeat."""

import numpy as np
import pandas as pd
import pytest
from logs import FRD, car_log, columns

from jerkbench.datasets.table import Tables
from jerkbench.errors import RecordingError
from jerkbench.inspection.guessing import guess_tables
from jerkbench.io.column_names import parse_name

G_MPS2 = 9.80665


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    """The first 60 s of the drive: IMU (FLU, m/s2, rad/s) and fixes."""
    log = car_log(tmp_path_factory.mktemp("car"))
    imu, fixes, _ = (pd.read_csv(path) for path in log.paths)
    t_s = (imu["timestamp"] - imu["timestamp"][0]).to_numpy()
    rows, early = t_s < 60, (fixes["timestamp"] - imu["timestamp"][0] < 60).to_numpy()
    fix_s = (fixes["timestamp"] - imu["timestamp"][0]).to_numpy()[early]
    places = fixes[["lat", "lon", "alt"]].to_numpy()[early]
    return t_s[rows], log.force_mps2[rows], log.rate_radps[rows], fix_s, places


def guessed(folder, **tables):
    paths = [folder / f"{name}.csv" for name in tables]
    for path, table in zip(paths, tables.values(), strict=True):
        pd.DataFrame(table).to_csv(path, index=False)
    return guess_tables(*paths)


def values(draft):
    return {name: guess.value for name, guess in draft.guesses.items()}


def test_the_names_of_px4(car, tmp_path):
    t_s, force, rate, fix_s, places = car
    imu = {"timestamp": np.round((t_s + 31) * 1e6).astype(int)}
    imu |= columns([f"gyro_rad[{k}]" for k in range(3)], rate @ FRD)
    imu |= columns([f"accelerometer_m_s2[{k}]" for k in range(3)], force @ FRD)
    gps = {"timestamp": np.round((fix_s + 31) * 1e6).astype(int), "time_utc_usec": 0}
    gps |= columns(["latitude_deg", "longitude_deg", "altitude_ellipsoid_m"], places)
    gps |= {"altitude_msl_m": 1.0, "eph": 0.5, "epv": 0.8}
    draft = guessed(tmp_path, imu=imu, gps=gps)
    recording = draft.load()

    assert values(draft)["time_unit"] == "us"
    assert draft.guesses["imu_axes"].value[2] == "-z"
    assert (len(recording.imu.t_s), len(recording.position.t_s)) == (len(t_s), len(fix_s))
    np.testing.assert_allclose(np.diag(recording.position.covariance_m2[0]), [0.25, 0.25, 0.64])


def test_the_names_of_rostopic_with_the_stamp_of_the_header(car, tmp_path):
    t_s, force, rate, fix_s, places = car
    ns, late = 1_715_000_000_000_000_000, 40_000_000
    imu_ns, fix_ns = (ns + np.round(seconds * 1e9).astype(int) for seconds in (t_s, fix_s))
    imu = {"%time": imu_ns + late, "field.header.stamp": imu_ns}
    imu |= columns([f"field.angular_velocity.{axis}" for axis in "xyz"], rate)
    imu |= columns([f"field.linear_acceleration.{axis}" for axis in "xyz"], force)
    fix = {"%time": fix_ns + late, "field.header.stamp": fix_ns}
    fix |= columns(["field.latitude", "field.longitude", "field.altitude"], places)
    fix |= columns(
        [f"field.position_covariance{k}" for k in range(9)], np.tile([1, 0, 0, 0, 2, 0, 0, 0, 3], (len(fix_s), 1))
    )
    draft = guessed(tmp_path, imu=imu, fix=fix)

    assert values(draft)["imu_time"] == values(draft)["position_time"] == "field.header.stamp"
    np.testing.assert_allclose(draft.load().position.covariance_m2[0], np.diag([1.0, 2.0, 3.0]))


def test_accelerometer_and_gyro_in_two_files_whose_columns_are_x_y_z(car, tmp_path):
    t_s, force, rate, fix_s, places = car
    tables = {
        "TotalAcceleration": {"time": np.round((1.7e9 + t_s) * 1e9)} | columns(["z", "y", "x"], force[:, ::-1]),
        "Gyroscope": {"time": np.round((1.7e9 + t_s + 0.003) * 1e9)} | columns(["z", "y", "x"], rate[:, ::-1]),
        "Location": {"time": np.round((1.7e9 + fix_s) * 1e9)} | columns(["latitude", "longitude", "altitude"], places),
    }
    draft = guessed(tmp_path, **tables)
    imu = draft.load().imu

    assert values(draft)["gyro_file"] == "Gyroscope.csv"
    np.testing.assert_allclose(imu.accel_mps2, force[1:] if len(imu.t_s) < len(force) else force, atol=1e-6)
    assert np.corrcoef(imu.gyro_radps[:, 2], rate[-len(imu.t_s) :, 2])[0, 1] > 0.99


def test_one_of_two_mixed_sensors_is_used(car, tmp_path):
    t_s, force, rate, *_ = car
    first = {"TimeUS": np.round(t_s * 1e6), "I": 0}
    first |= columns(["GyrX", "GyrY", "GyrZ"], rate) | columns(["AccX", "AccY", "AccZ"], force)
    second = pd.DataFrame(first).assign(I=1, AccX=7.0)
    mixed = pd.concat([pd.DataFrame(first), second]).sort_values(["TimeUS", "I"])
    draft = guessed(tmp_path, imu=mixed)

    np.testing.assert_allclose(draft.load(position_file="").imu.accel_mps2, force, atol=1e-6)


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")])
@pytest.mark.parametrize("name", ["iTOW", "tow", "time_of_week"])
def test_a_time_of_week_is_no_date(car, tmp_path, scale, unit, name):
    *_, fix_s, places = car
    table = {name: np.round((243_618 + fix_s[::5]) * scale, 1)} | columns(["lat", "lon", "height"], places[::5])
    draft = guessed(tmp_path, gps=table)

    assert (values(draft)["time_unit"], values(draft)["epoch"]) == (unit, "none")
    np.testing.assert_allclose(np.diff(draft.load().position.t_s), np.diff(fix_s[::5]), atol=1e-6)


@pytest.mark.parametrize("unit", ["1e-7 deg", "ddmm"])
def test_angles_of_receivers(car, tmp_path, unit):
    *_, fix_s, places = car
    whole, part = np.divmod(places[:, :2], 1.0)
    angles = {"1e-7 deg": np.round(places[:, :2] * 1e7), "ddmm": 100 * whole + 60 * part}[unit]
    height = np.round(places[:, 2] * 1000) if unit == "1e-7 deg" else places[:, 2]
    draft = guessed(tmp_path, gps={"t": fix_s} | columns(["lat", "lon", "alt"], np.column_stack([angles, height])))
    recording = draft.load()

    assert draft.guesses["angle_unit"].value == unit
    assert draft.guesses["angle_unit"].grade == "measured"
    np.testing.assert_allclose([recording.origin.latitude_deg, recording.origin.height_m], places[0, [0, 2]], atol=2e-3)
    assert len(recording.position.t_s) == len(fix_s)


def test_fixes_that_a_logger_repeats_are_one_and_zeros_are_none(car, tmp_path):
    t_s, force, rate, fix_s, places = car
    last = np.searchsorted(fix_s, t_s + 1e-9, side="right") - 1
    repeated = np.where((t_s >= 3)[:, None], places[np.maximum(last, 0)], 0.0)
    table = {"t": t_s} | columns(["ax", "ay", "az"], force) | columns(["gx", "gy", "gz"], rate)
    recording = guessed(tmp_path, all=table | columns(["lat", "lon", "alt"], repeated)).load()

    assert len(recording.position.t_s) == pytest.approx((fix_s >= 3).sum(), abs=2)
    assert any("held until the next measurement: dropped" in note for note in recording.notes)
    assert any("a position of zeros (no fix): dropped" in note for note in recording.notes)


def test_doubled_and_unordered_rows_are_repaired_and_counted(car, tmp_path):
    *_, fix_s, places = car
    table = pd.DataFrame({"t": fix_s} | columns(["lat", "lon", "alt"], places))
    table = pd.concat([table, table.iloc[[5, 9]]]).sort_values("t", kind="stable").reset_index(drop=True)
    table.iloc[[20, 21]] = table.iloc[[21, 20]].to_numpy()
    recording = guessed(tmp_path, gps=table).load()

    np.testing.assert_allclose(recording.position.t_s, fix_s - fix_s[0], atol=1e-9)
    assert any("2 of" in note and "the stamp of another row: dropped" in note for note in recording.notes)
    assert any("1 of" in note and ": sorted." in note for note in recording.notes)


def test_different_rows_with_the_same_whole_second_are_refused_with_the_reason(car, tmp_path):
    t_s, force, rate, *_ = car
    table = {"t": np.floor(1.7e9 + t_s)} | columns(["ax", "ay", "az"], force) | columns(["gx", "gy", "gz"], rate)
    with pytest.raises(RecordingError, match=r"rounded to whole seconds \(about 100 different rows with each\)"):
        Tables(**guessed(tmp_path, imu=table).settings).load(0)


def test_columns_of_standard_deviations_that_are_all_zero_are_named_with_the_remedy(car, tmp_path):
    *_, fix_s, places = car
    table = pd.DataFrame({"t": fix_s, "sd": 0.0} | columns(["lat", "lon", "alt"], places))
    table.to_csv(tmp_path / "gps.csv", index=False)
    given = {"imu_file": "", "position_file": "gps.csv", "position_time": "t"}
    given |= {"position_columns": ("lat", "lon", "alt"), "position_sigma": ("sd",), "epoch": "none"}
    with pytest.raises(
        RecordingError, match=r"none of the \d+ rows has a standard deviation above 0 in the columns sd;"
    ):
        Tables(str(tmp_path), **given).load(0)
    table.loc[3:, "sd"] = 2.0
    table.to_csv(tmp_path / "gps.csv", index=False)
    recording = Tables(str(tmp_path), **given, position_sigma_m=5.0).load(0)
    np.testing.assert_allclose(recording.position.covariance_m2[[0, 5], 0, 0], [25.0, 4.0])
    assert any("3 of" in note and "no standard deviation: 5 is used" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("column", "meaning"),
    [
        ("a_RS_S_x [m s^-2]", ("accel", "x", "m/s2")),
        ("/imu/data/angular_velocity/z", ("gyro", "z", "")),
        ("Gyroscope x (rad/s)", ("gyro", "x", "rad/s")),
        ("LatitudeDegrees", ("latitude", "", "deg")),
        ("horizontalAccuracy", ("sigma", "horizontal", "m")),
        ("velN", ("velocity", "north", "")),
        ("GMS", ("tow", "", "ms")),
        ("position_latitude_deg", ("latitude", "", "deg")),
        ("X (m/s^2)", ("accel", "x", "m/s2")),
        ("Z (rad/s)", ("gyro", "z", "rad/s")),
        ("x (m)", ("position", "x", "m")),
        ("Horizontal Accuracy (m)", ("sigma", "horizontal", "m")),
        ("vehicle_gps_position.lat", ("latitude", "", "")),
        ("sensor_combined/accelerometer_m_s2.01", ("accel", "y", "m/s2")),
        ("/vehicle_gps_position_0/vel_n_m_s", ("velocity", "north", "m/s")),
    ],
)
def test_names_of_other_loggers(column, meaning):
    assert parse_name(column)[1:] == meaning


def test_the_covariance_that_data_convert_writes(car, tmp_path):
    t_s, force, rate, fix_s, places = car
    imu = {"t_s": t_s} | columns(["ax", "ay", "az"], force) | columns(["gx", "gy", "gz"], rate)
    six = [f"position_variance_{element}_m2" for element in ("11", "22", "33", "12", "13", "23")]
    gps = {"t_s": fix_s} | columns(
        [f"position_{name}" for name in ("latitude_deg", "longitude_deg", "height_m")], places
    )
    gps |= columns(six, np.tile([4.0, 5.0, 9.0, 1.0, 2.0, 3.0], (len(fix_s), 1)))
    recording = guessed(tmp_path, imu=imu, gps=gps).load()

    np.testing.assert_allclose(recording.position.covariance_m2[0], [[4, 1, 2], [1, 5, 3], [2, 3, 9]])


def test_accelerations_beside_a_position_are_not_the_imu_if_another_file_has_one(car, tmp_path):
    t_s, force, rate, fix_s, places = car
    imu = {"t": t_s} | columns(["ax", "ay", "az"], force) | columns(["gx", "gy", "gz"], rate)
    local = {"t": fix_s} | columns(["lat", "lon", "alt"], places)
    local |= columns(["ax", "ay", "az"], np.zeros((len(fix_s), 3)))
    draft = guessed(tmp_path, local=local, imu=imu)

    assert (values(draft)["imu_file"], values(draft)["position_file"]) == ("imu.csv", "local.csv")


def test_units_of_the_reference_may_differ_from_those_of_the_fixes(car, tmp_path):
    t_s, force, rate, fix_s, places = car
    imu = {"timestamp": np.round((t_s + 31) * 1e6).astype(int)}
    imu |= columns([f"gyro_rad[{k}]" for k in range(3)], rate) | columns(["ax", "ay", "az"], force)
    stamps = {"timestamp": np.round((fix_s + 31) * 1e6).astype(int)}
    gps = stamps | columns(["lat", "lon", "alt"], np.round(places * [1e7, 1e7, 1e3]).astype(int))
    truth = stamps | columns(["lat", "lon", "alt"], places) | columns(["vn", "ve", "vd"], np.ones((len(fix_s), 3)))
    draft = guessed(tmp_path, imu=imu, gps=gps, truth=truth)
    recording = draft.load()

    assert values(draft)["angle_unit"] == "1e-7 deg"
    assert values(draft)["reference_angle_unit"] == "deg"
    assert values(draft)["reference_height_unit"] == "m"
    np.testing.assert_allclose(recording.reference.enu_m, recording.position.enu_m, atol=0.02)
    np.testing.assert_allclose(recording.reference.velocity_mps, np.tile([1.0, 1.0, -1.0], (len(fix_s), 1)))


@pytest.mark.parametrize(("bias_degps", "removed"), [(0.0, None), (0.2, True)])
def test_the_bias_of_a_gyro_at_rest_is_removed(tmp_path, bias_degps, removed):
    imu_path, *others = car_log(tmp_path).paths  # with 9 s of rest, and a gyro in deg/s
    imu = pd.read_csv(imu_path)
    (x, *_) = (name for name in imu if (known := parse_name(name)) and known.quantity == "gyro")
    imu[x] += bias_degps
    imu.to_csv(imu_path, index=False)
    draft = guess_tables(imu_path, *others)

    assert values(draft)["static_start_s"] == 9.0
    assert values(draft).get("remove_gyro_bias") is removed
