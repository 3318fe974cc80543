"""Logs whose truth is known: every guess is right, or says that it is unsure."""

import numpy as np
import pytest
from logs import GAP_S, LATE_S, SIGMA_M, car_log, columns, kitti_like, ned_degrees

from jerkbench.datasets.field import FieldWhite
from jerkbench.errors import RecordingError
from jerkbench.geometry import enu_to_geodetic
from jerkbench.inspection.guessing import guess_tables
from jerkbench.io.column_names import parse_name
from jerkbench.recording import Origin

RIGHT = {
    "time_unit": "ms",
    "accel_unit": "g",
    "gyro_unit": "deg/s",
    "imu_axes": ("x", "-y", "-z"),
    "position_frame": "ned",
    "velocity_frame": "ned",
}
AT = Origin(48.0, 11.0, 500.0)


@pytest.fixture(scope="module")
def drive():
    return FieldWhite(duration_s=240.0).load(0)


def guessed(log, folder):
    log.to_csv(folder / "drive.csv", index=False)
    return guess_tables(folder / "drive.csv")


@pytest.mark.parametrize("units", [True, False])
def test_a_log_in_ned_with_degrees_comes_out_right(drive, tmp_path, units):
    draft = guessed(ned_degrees(drive, units=units), tmp_path)
    recording = draft.load()

    assert {name: draft.guesses[name].value for name in RIGHT} == RIGHT
    assert all(draft.guesses[name].grade == "measured" for name in RIGHT if name != "time_unit")
    np.testing.assert_allclose(recording.imu.accel_mps2, drive.imu.accel_mps2, atol=1e-9)
    np.testing.assert_allclose(recording.imu.gyro_radps, drive.imu.gyro_radps, atol=1e-9)
    np.testing.assert_allclose(recording.position.enu_m, drive.position.enu_m, atol=1e-9)
    np.testing.assert_allclose(recording.velocity.mps, drive.velocity.mps, atol=1e-9)


@pytest.mark.parametrize(("first", "epoch"), [(1_751_700_000_000, "unix"), (86_400_000, "none")])
def test_stamps_are_dates_by_their_size_whatever_the_column_is_called(drive, tmp_path, first, epoch):
    log = ned_degrees(drive, units=True)
    log["time_ms"] += first
    draft = guessed(log, tmp_path)

    assert (draft.guesses["time_unit"].value, draft.guesses["epoch"].value) == ("ms", epoch)
    assert (draft.load().start_utc is not None) == (epoch == "unix")
    if epoch == "unix":
        assert draft.load().start_utc.year == 2025


@pytest.mark.parametrize(("unit", "scale"), [("us", 10**3), ("ns", 10**6)])
@pytest.mark.parametrize("named", [True, False])
def test_stamps_of_ros_and_of_autopilots_are_no_measurements_that_are_too_large(drive, tmp_path, unit, scale, named):
    log = ned_degrees(drive, units=True)
    stamps = ((log.pop("time_ms") + 1_751_700_000_000).round().astype("int64")) * scale
    log.insert(0, f"timestamp_{unit}" if named else "timestamp", stamps)
    draft = guessed(log, tmp_path)

    assert (draft.guesses["time_unit"].value, draft.guesses["epoch"].value) == (unit, "unix")
    assert draft.load().start_utc.year == 2025


@pytest.mark.parametrize(
    ("names", "scale", "grade", "order"),
    [
        (("sdn_mm", "sde_mm", "sdu_mm"), 0.001, "named", [1, 0, 2]),
        (("std_e (cm)", "std_n (cm)", "std_u (cm)"), 0.01, "named", [0, 1, 2]),
        (("sigma_north", "sigma_east", "sigma_down"), 1.0, "unsure", [1, 0, 2]),
    ],
)
def test_standard_deviations_of_places_are_read_in_their_unit(drive, tmp_path, names, scale, grade, order):
    log, true_m = ned_degrees(drive, units=True), np.array([0.7, 0.3, 1.9])
    for name, axis in zip(names, order, strict=True):
        log[name] = np.where(log["north_m"].notna(), true_m[axis] / scale, np.nan)
    draft = guessed(log, tmp_path)

    assert draft.guesses["position_sigma_scale"].grade == grade
    assert not set(names) & set(draft.unused)
    sigma = np.sqrt(np.diagonal(draft.load().position.covariance_m2, axis1=1, axis2=2))
    np.testing.assert_allclose(sigma, np.tile(true_m, (len(sigma), 1)), rtol=1e-9)


def test_standard_deviations_of_nothing_are_not_used(drive, tmp_path):
    log = ned_degrees(drive, units=True)
    log[["sdn_mm", "sde_mm", "sdu_mm"]] = 0.0
    assert guessed(log, tmp_path).guesses["position_sigma_m"].grade == "unsure"


def test_a_log_with_the_names_of_kitti_comes_out_right(drive, tmp_path):
    draft = guessed(kitti_like(drive, enu_to_geodetic(drive.position.enu_m, AT)), tmp_path)
    values = {name: guess.value for name, guess in draft.guesses.items()}

    assert values["position_columns"] == ("lat", "lon", "alt")
    assert (values["position_frame"], values["angle_unit"], values["time_unit"]) == ("geodetic", "deg", "s")
    assert (values["accel_unit"], values["gyro_unit"], values["imu_axes"]) == ("m/s2", "rad/s", ("x", "y", "z"))
    assert (values["velocity_columns"], values["velocity_frame"]) == (("ve", "vn", "vu"), "enu")
    assert draft.unused == ["navstat"]


def test_an_imu_that_is_turned_about_the_upward_axis_is_seen(drive, tmp_path):
    log = ned_degrees(drive, units=True)
    for kind, unit in (("acc", "g"), ("gyro", "dps")):
        x, y = f"{kind}_x_{unit}", f"{kind}_y_{unit}"
        log[x], log[y] = log[y].copy(), -log[x]  # the sensor's x is the body's right, its y the body's back
    draft = guessed(log, tmp_path)

    assert draft.guesses["imu_axes"].value == ("-y", "-x", "-z")
    np.testing.assert_allclose(draft.load().imu.accel_mps2, drive.imu.accel_mps2, atol=1e-9)


def test_a_log_that_stands_says_what_it_cannot_tell(tmp_path):
    import pandas as pd

    draw, t_s = np.random.default_rng(0), np.arange(0, 60, 0.1)
    data = {"t": t_s} | columns(["ax", "ay", "az"], draw.normal([0, 0, 9.8], 0.05, (600, 3)))
    data |= columns(["gx", "gy", "gz"], draw.normal(0, 0.01, (600, 3))) | columns(
        ["x", "y", "z"], draw.normal(0, 1, (600, 3))
    )
    draft = guessed(pd.DataFrame(data), tmp_path)
    unsure = {name for name, guess in draft.guesses.items() if guess.grade == "unsure"}

    assert {"gyro_unit", "position_frame", "imu_axes"} <= unsure
    assert draft.guesses["accel_unit"].grade == "measured"


def test_names_that_say_nothing_are_not_guessed(drive, tmp_path):
    log = ned_degrees(drive, units=True)
    log.columns = [f"c{k}" for k in range(len(log.columns))]

    with pytest.raises(RecordingError, match=r"has the columns c0, c1, .*Neither the three columns of a position"):
        guessed(log, tmp_path)


@pytest.mark.parametrize(
    ("column", "meaning"),
    [
        ("Acc X (m/s^2)", ("accel", "x", "m/s2")),
        ("imu_gyro_z_dps", ("gyro", "z", "deg/s")),
        ("linear_acceleration.y", ("accel", "y", "")),
        ("Ang Rate X (deg/s)", ("gyro", "x", "deg/s")),
        ("velNorth", ("velocity", "north", "")),
        ("gps_longitude_deg", ("longitude", "", "deg")),
        ("down", ("position", "down", "")),
        ("time_ms", ("time", "", "ms")),
        ("sdn_mm", ("sigma", "north", "mm")),
    ],
)
def test_a_name_is_taken_apart(column, meaning):
    assert parse_name(column)[1:] == meaning


@pytest.mark.parametrize(
    "column", ["c1", "temperature", "north_mm", "sdne_mm", "reference_east_m", "navstat", "speed_limit", "x_raw"]
)
def test_a_name_that_says_nothing_known_is_none(column):
    assert parse_name(column) is None


# A log in two files or three, one for the IMU, one for the fixes, one for the truth.


@pytest.mark.parametrize("week", [False, True])
def test_a_log_in_three_files_comes_out_right_with_its_late_imu_and_its_outage(tmp_path, week):
    car = car_log(tmp_path, week=week)
    draft = guess_tables(*car.paths)
    values = {name: guess.value for name, guess in draft.guesses.items()}
    recording = draft.load()
    since_s = np.round(LATE_S + values["imu_shift_s"], 6)  # what is left of the IMU's lateness, at time 0

    assert since_s == pytest.approx(0.0, abs=0.02)
    assert values["epoch"] == ("gps" if week else "unix")
    assert (values["outage_s"], values["static_start_s"]) == (5.0, 9.0)
    np.testing.assert_allclose(recording.imu.accel_mps2, car.force_mps2, atol=1e-6)
    np.testing.assert_allclose(recording.imu.gyro_radps, car.rate_radps, atol=1e-8)
    np.testing.assert_allclose(recording.position.t_s, car.fix_s - since_s, atol=2e-6)
    np.testing.assert_allclose(recording.position.covariance_m2, np.tile(np.diag(SIGMA_M**2), (len(car.fix_s), 1, 1)))
    driven_m = recording.reference.enu_m - recording.reference.enu_m[0]
    np.testing.assert_allclose(driven_m[:, :2], car.true_m[:, :2], atol=0.2)  # linear in the angles, over 1 km
    np.testing.assert_allclose(recording.outages_s, [np.array(GAP_S) - since_s], atol=0.21)
    assert recording.start_utc.isoformat()[:19] == "2024-05-14T14:00:00"


def test_files_by_two_clocks_are_a_sentence(tmp_path):
    import pandas as pd

    paths = car_log(tmp_path).paths
    table = pd.read_csv(paths[0])
    table["timestamp"] -= table["timestamp"][0]
    table.to_csv(paths[0], index=False)

    with pytest.raises(RecordingError, match="use the same clock in all files"):
        guess_tables(*paths)


def test_two_imus_are_a_sentence(tmp_path):
    paths = car_log(tmp_path).paths

    with pytest.raises(RecordingError, match="Give one file with an IMU, one with fixes"):
        guess_tables(paths[0], paths[0], paths[1])


def test_a_track_of_a_receiver_needs_no_names(tmp_path):
    rows = "".join(f"<trkpt lat='48.1' lon='11.{k:04}'><time>2024-05-14T12:35:{k:02}Z</time></trkpt>" for k in range(9))
    (tmp_path / "a.gpx").write_text(f"<gpx><trk><trkseg>{rows}</trkseg></trk></gpx>")
    draft = guess_tables(tmp_path / "a.gpx")

    assert len(draft.load().position.t_s) == 9
    assert draft.guesses["position_frame"].value == "geodetic"
