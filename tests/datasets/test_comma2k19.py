"""A segment made by hand with independent geodesy, and the real minute where it is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.datasets.comma2k19 import Comma2k19
from jerkbench.disturbances.outages import GnssOutage
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins.checks import check_plugin

LATITUDE, LONGITUDE, HEIGHT = np.radians(37.0), np.radians(-122.0), 30.0
LOG_S = 1000.0
AHEAD = {"mounting_yaw_deg": 0.0, "mounting_pitch_deg": 0.0}


def ecef(latitude, longitude, height):
    """By the closed form of the ellipsoid WGS-84."""
    a, e2 = 6378137.0, 0.00669437999014
    n = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    horizontal = (n + height) * np.cos(latitude)
    return np.stack(
        [horizontal * np.cos(longitude), horizontal * np.sin(longitude), (n * (1 - e2) + height) * np.sin(latitude)], -1
    )


def enu_axes():
    """East, north, up as columns in ECEF."""
    s, c, sl, cl = np.sin(LATITUDE), np.cos(LATITUDE), np.sin(LONGITUDE), np.cos(LONGITUDE)
    return np.array([[-sl, -s * cl, c * cl], [cl, -s * sl, c * sl], [0.0, c, s]])


def write_segment(folder, **changes):
    """Ten seconds level towards the north at 10 m/s, the device forward-right-down; fixes jitter in the log."""
    frames, imu = np.arange(201) * 0.05 + LOG_S - 0.03, np.arange(1001) * 0.01 + LOG_S
    utc_ms = 1.5e12 + 100.0 * np.arange(101)
    jitter = 0.02 * np.sign(np.sin(np.arange(101) * 2.0))
    jitter -= np.polyval(np.polyfit(utc_ms - utc_ms[0], jitter, 1), utc_ms - utc_ms[0])
    north_rad = 10.0 * (np.arange(101) * 0.1) / 6.36e6
    axes = enu_axes()
    north_right_down = np.column_stack([axes[:, 1], axes[:, 0], -axes[:, 2]])
    quaternion = Rotation.from_matrix(north_right_down).as_quat(scalar_first=True)
    one, three = np.ones(101), np.ones((1001, 1))
    files = {
        "global_pose/frame_times": frames,
        "global_pose/frame_positions": ecef(LATITUDE, LONGITUDE, HEIGHT)
        + np.outer(10.0 * (frames - frames[0]), axes[:, 1]),
        "global_pose/frame_velocities": np.tile(10.0 * axes[:, 1], (201, 1)),
        "global_pose/frame_orientations": np.tile(quaternion, (201, 1)),
        "processed_log/IMU/accelerometer/t": imu,
        "processed_log/IMU/accelerometer/value": three * [0.1, 0.2, -9.8],
        "processed_log/IMU/gyro/value": three * [0.01, 0.02, 0.03],
        "processed_log/GNSS/live_gnss_ublox/t": LOG_S + 0.05 + 0.1 * np.arange(101) + jitter,
        "processed_log/GNSS/live_gnss_ublox/value": np.column_stack(
            [np.degrees(LATITUDE + north_rad), one * np.degrees(LONGITUDE), 10 * one, utc_ms, HEIGHT * one, one * 10.0]
        ),
        "processed_log/CAN/speed/t": imu[::2],
        "processed_log/CAN/speed/value": np.full((501, 1), 10.0),
    }
    for name, array in (files | changes).items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            np.save(file, array)
    return str(folder)


def test_a_first_fix_that_leaps_is_dropped_and_not_the_origin(tmp_path):
    write_segment(tmp_path)
    path = tmp_path / "processed_log/GNSS/live_gnss_ublox/value"
    whole = Comma2k19(str(tmp_path), **AHEAD).load(0)
    gnss = np.load(path)
    gnss[0, 0] += 1.0
    with path.open("wb") as file:
        np.save(file, gnss)
    recording = Comma2k19(str(tmp_path), **AHEAD).load(0)
    origin = recording.origin
    np.testing.assert_array_equal((origin.latitude_deg, origin.longitude_deg, origin.height_m), gnss[1, [0, 1, 4]])
    np.testing.assert_array_equal(recording.position.t_s, whole.position.t_s[1:])
    np.testing.assert_allclose(recording.position.enu_m, whole.position.enu_m[1:] - whole.position.enu_m[1], atol=1e-4)
    assert "GNSS: 1 of 101 rows have a position more than 50 m from its neighbours: dropped." in recording.notes


def test_fixes_stand_on_the_line_less_their_age_and_the_bearing_is_a_course(tmp_path):
    recording = Comma2k19(write_segment(tmp_path), position_age_s=0.08).load(0)
    np.testing.assert_allclose(recording.position.t_s, 0.05 + 0.1 * np.arange(101) - 0.08, atol=1e-9)
    np.testing.assert_allclose(recording.position.covariance_m2[3], 0.25 * np.eye(3))
    assert recording.start_utc.timestamp() == pytest.approx(1.5e9 - 0.05, abs=1e-5)
    assert (recording.static_start_s, recording.imu.t_s[0]) == (0.0, 0.0)
    heading = Comma2k19(write_segment(tmp_path), course_age_s=0.1).load(0).heading
    assert heading.source == "course"
    np.testing.assert_allclose(heading.yaw_rad, np.radians(80.0))
    np.testing.assert_allclose(heading.t_s, 0.1 * np.arange(101) - 0.05, atol=1e-9)
    assert len(Comma2k19(str(tmp_path), course_min_speed_mps=11.0).load(0).heading.t_s) == 0


def test_the_reference_is_in_enu_at_the_first_fix_and_the_imu_is_turned_to_forward_left_up(tmp_path):
    reference = Comma2k19(write_segment(tmp_path), **AHEAD).load(0).reference
    np.testing.assert_allclose(reference.t_s, np.arange(201) * 0.05 - 0.03, atol=1e-9)
    np.testing.assert_allclose(reference.enu_m, np.outer(np.arange(201) * 0.5, [0, 1, 0]), atol=1e-3)
    np.testing.assert_allclose(reference.velocity_mps, np.tile([0, 10.0, 0], (201, 1)), atol=1e-6)
    np.testing.assert_allclose(reference.euler_rad, np.tile([0, 0, np.pi / 2], (201, 1)), atol=1e-6)
    assert not reference.independent
    imu = Comma2k19(write_segment(tmp_path), **AHEAD).load(0).imu
    np.testing.assert_allclose(imu.accel_mps2[5], [0.1, -0.2, 9.8])
    np.testing.assert_allclose(imu.gyro_radps[5], [0.01, -0.02, -0.03])
    check_plugin("dataset", Comma2k19(write_segment(tmp_path)))


def test_the_mounting_turns_imu_and_reference_alike(tmp_path):
    """A device that sees the direction of travel 10 degrees up and 5 degrees to its left."""
    recording = Comma2k19(write_segment(tmp_path), mounting_yaw_deg=5.0, mounting_pitch_deg=-10.0).load(0)
    level = Comma2k19(str(tmp_path), **AHEAD).load(0)
    yaw, pitch = np.radians([5.0, 10.0])
    travel = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    device, body = (Rotation.from_euler("ZYX", r.reference.euler_rad[0][::-1].copy()) for r in (level, recording))
    np.testing.assert_allclose(body.apply([1, 0, 0]), device.apply(travel), atol=1e-9)
    forces = [r.imu.accel_mps2[0].copy() for r in (level, recording)]
    np.testing.assert_allclose(body.apply(forces[1]), device.apply(forces[0]), atol=1e-9)


def test_the_wheel_is_scaled_and_survives_an_outage(tmp_path):
    recording = Comma2k19(write_segment(tmp_path), wheel_scale=1.01, across_sigma_mps=0.2).load(0)
    velocity = recording.velocity
    assert velocity.frame == "speed"
    np.testing.assert_allclose(velocity.mps, np.tile([10.1, 0, 0], (501, 1)))
    np.testing.assert_allclose(velocity.covariance_m2ps2[0], np.diag([0.25, 0.04, 0.04]))
    np.testing.assert_allclose(velocity.t_s, np.arange(501) * 0.02, atol=1e-9)
    dark = GnssOutage(((2.0, 4.0),)).apply(recording, 0)
    assert len(dark.velocity.t_s) == 501
    assert not ((dark.position.t_s >= 2) & (dark.position.t_s < 4)).any()
    assert not ((dark.heading.t_s >= 2) & (dark.heading.t_s < 4)).any()
    assert Comma2k19(str(tmp_path), wheel=False).load(0).velocity is None


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"processed_log/IMU/gyro/value": np.zeros((5, 3))},
            r"the same number of rows.* 5 \(processed_log/IMU/gyro/value\); copy",
        ),
        ({"processed_log/IMU/gyro/value": np.zeros((1001, 2))}, r"shape \(1001, 2\); it must have 3 columns"),
        ({"processed_log/CAN/speed/value": np.full((501, 1), np.nan)}, "speed/value contains NaN"),
        ({"processed_log/CAN/speed/t": np.array([{}], dtype=object)}, "speed/t cannot be read as a NumPy array"),
        ({"processed_log/IMU/gyro/value": np.full((1001, 3), 1e3)}, "gyro/value, row 1 has a value beyond 100"),
        ({"processed_log/GNSS/live_gnss_ublox/value": np.full((101, 6), 1e200)}, "row 1 has a value beyond 1e"),
        ({"global_pose/frame_times": np.zeros(201)}, "t_s row 1 .* does not increase"),
        ({"processed_log/GNSS/live_gnss_ublox/value": np.zeros((101, 6))}, "101 rows have a position of zeros"),
        ({"processed_log/GNSS/live_gnss_ublox/value": np.full((101, 6), [48, 11, 0, 1.6e12, 0, 0])}, "UTC of fix 1 is"),
    ],
)
def test_damaged_files_are_sentences(tmp_path, changes, said):
    folder = write_segment(tmp_path)
    write_segment(tmp_path, **changes)
    with pytest.raises(RecordingError, match=said):
        Comma2k19(folder).load(0)


def test_a_missing_file_is_named(tmp_path):
    folder = write_segment(tmp_path)
    (tmp_path / "global_pose" / "frame_times").unlink()
    with pytest.raises(RecordingError, match="frame_times"):
        Comma2k19(folder).load(0)
    with pytest.raises(RecordingError, match="frame_times"):
        Comma2k19(folder).fingerprint()
    with pytest.raises(PluginError, match="wheel_scale"):
        Comma2k19(folder, wheel_scale=0.0)


def test_the_real_minute_has_the_published_facts(shared_folder):
    """Errors of the fixes: bias (-.4, 0, 1.07) m and .09, .16, .40 m; the wheel within .06 m/s."""
    from scipy.interpolate import CubicSpline

    recording = Comma2k19(str(shared_folder / "data" / "comma2k19")).load(0)
    reference = recording.reference
    inside = (recording.position.t_s > 0.1) & (recording.position.t_s < 59.8)
    path = CubicSpline(reference.t_s, reference.enu_m)
    error = recording.position.enu_m[inside] - path(recording.position.t_s[inside])
    np.testing.assert_allclose(error.mean(axis=0), [-0.39, 0.02, 1.07], atol=0.03)
    np.testing.assert_allclose(error.std(axis=0), [0.09, 0.16, 0.40], atol=0.01)
    assert len(recording.position.t_s) == 579
    speed = np.linalg.norm(CubicSpline(reference.t_s, reference.velocity_mps)(recording.velocity.t_s[5:-20]), axis=1)
    assert np.std(recording.velocity.mps[5:-20, 0] - speed) < 0.06
    body = Rotation.from_euler("ZYX", reference.euler_rad[:, ::-1].copy())
    travel = body.inv().apply(reference.velocity_mps.copy())
    np.testing.assert_allclose(np.degrees(np.median(travel[:, 1:] / travel[:, :1], axis=0)), 0, atol=0.05)
    yaw_error = np.interp(recording.heading.t_s, reference.t_s, reference.euler_rad[:, 2]) - recording.heading.yaw_rad
    assert abs(np.degrees(yaw_error[2:-2].mean())) < 0.1
