import struct
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from jerkbench import plugins
from jerkbench.datasets.rtklib import RtklibDrive
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.tracks import _POS_HEADER

DRIVE = Path(__file__).parents[2].parent / "shared" / "data" / "rtklib_drive_0708"
START = datetime(2025, 7, 8, 19, 34, 18, tzinfo=UTC)  # GPST, as if it were UTC
needs_drive = pytest.mark.skipif(not DRIVE.is_dir(), reason="the real drive is not in ../shared/data")

PLAIN = {
    "imu_axis_signs": (1.0, 1.0, 1.0),
    "mounting_yaw_deg": 0.0,
    "mounting_pitch_deg": 0.0,
    "imu_shift_s": 0.0,
    "velocity_latency_s": (0.0, 0.0, 0.0),
}


def write_drive(folder, *, moves_at=4.0, quality=1, accel=(0.0, 0.0, 1.0)):
    """Eight seconds: fixes every 0.5 s from the start, the IMU at 100 Hz from 1 s on; drives east at 2 m/s."""
    rows = []
    for i in range(17):
        t = i * 0.5
        stamp = (START + timedelta(seconds=t)).strftime("%Y/%m/%d %H:%M:%S.%f")[:-3]
        speed = 2.0 if t >= moves_at else 0.0
        lon = 10.0 + max(0.0, t - moves_at) * 2e-5
        rows.append(
            f"{stamp} 45.0 {lon:.9f} {100 + i * 0.1:.3f} {quality if i else 1} 9"
            f" .01 .01 .02 0 0 0 0 0 0 {speed} 0.5 .1 .1 .2 0 0 0"
        )
    (folder / "a.pos").write_text("\n".join([f"% {_POS_HEADER}", *rows, ""]))
    ms = np.arange(701) * 10 + 5000
    imu = [f"{accel[0]},{accel[1]},{accel[2]},1,2,3,{m}" for m in ms]
    (folder / "a.csv").write_text("\n".join([*imu, ""]))
    head = b"TIMETAG RTKLIB".ljust(60, b"\0") + struct.pack("<IId", 0, int(START.timestamp()) + 1, 0.0)
    (folder / "a.csv.tag").write_bytes(head + struct.pack("<II", 7000, 1))
    return str(folder)


def test_time_zero_is_the_first_true_imu_sample(tmp_path):
    folder = write_drive(tmp_path)
    recording = RtklibDrive(folder, **PLAIN).load(0)
    assert (recording.imu.t_s[0], recording.position.t_s[0], recording.reference.t_s[-1]) == (0.0, -1.0, 7.0)
    assert recording.start_utc == START + timedelta(seconds=1 - 18)
    shifted = RtklibDrive(folder, **(PLAIN | {"imu_shift_s": -0.2})).load(0)
    assert shifted.imu.t_s[0] == 0.0
    np.testing.assert_allclose(shifted.position.t_s, recording.position.t_s + 0.2, atol=1e-9)
    assert shifted.start_utc == recording.start_utc - timedelta(seconds=0.2)


def test_positions_are_east_of_the_first_fix_and_velocities_stand_where_they_were_true(tmp_path):
    recording = RtklibDrive(write_drive(tmp_path), **PLAIN).load(0)
    assert (recording.origin.latitude_deg, recording.origin.longitude_deg, recording.origin.height_m) == (45, 10, 100)
    a, e2 = 6378137.0, 0.00669437999014
    normal = a / np.sqrt(1 - e2 / 2) + 100  # radius in the prime vertical at 45 deg, plus height
    east_m = np.radians(4 * 2e-5) * normal * np.cos(np.pi / 4)
    np.testing.assert_allclose(recording.position.enu_m[-1], [east_m, 0, 1.6], atol=1e-3)
    np.testing.assert_array_equal(recording.reference.enu_m, recording.position.enu_m)
    np.testing.assert_allclose(recording.position.covariance_m2[3], np.diag([1e-4, 1e-4, 4e-4]))
    np.testing.assert_array_equal(recording.velocity.mps[-1], [2.0, 0.0, 0.5])
    assert recording.reference.velocity_mps is None
    assert recording.reference.euler_rad is None
    assert not recording.reference.independent
    recording = RtklibDrive(write_drive(tmp_path), **(PLAIN | {"velocity_latency_s": (0.1, 0.1, 0.3)})).load(0)
    velocity, stamps = recording.velocity, recording.position.t_s
    np.testing.assert_allclose(velocity.t_s[np.isfinite(velocity.mps[:, 0])], stamps - 0.1, atol=1e-9)
    np.testing.assert_allclose(velocity.t_s[np.isfinite(velocity.mps[:, 2])], stamps - 0.3, atol=1e-9)


def test_the_imu_is_turned_scaled_and_freed_of_its_bias(tmp_path):
    folder = write_drive(tmp_path, accel=(0.0, 0.6, 0.82))
    imu = RtklibDrive(folder, **PLAIN).load(0).imu
    assert np.linalg.norm(imu.accel_mps2[0]) == pytest.approx(9.81)
    np.testing.assert_allclose(imu.gyro_radps, 0, atol=1e-12)
    as_it_is = PLAIN | {"remove_gyro_bias": False, "scale_accel_to_gravity": False}
    raw = RtklibDrive(folder, **(as_it_is | {"imu_axis_signs": (-1.0, 1.0, 1.0)})).load(0).imu
    np.testing.assert_allclose(raw.gyro_radps[5], np.radians([-1, 2, 3]))
    np.testing.assert_allclose(raw.accel_mps2[5], 9.80665 * np.array([0, 0.6, 0.82]))
    quarter = RtklibDrive(folder, **(as_it_is | {"mounting_yaw_deg": 90.0, "gyro_unit": "rad/s", "accel_unit": "m/s2"}))
    np.testing.assert_allclose(quarter.load(0).imu.gyro_radps[5], [2, -1, 3], atol=1e-12)
    np.testing.assert_allclose(quarter.load(0).imu.accel_mps2[5], [0.6, 0, 0.82], atol=1e-12)


def test_rest_and_scoring_follow_the_receivers_speed(tmp_path):
    folder = write_drive(tmp_path)
    recording = RtklibDrive(folder, **PLAIN).load(0)
    assert recording.static_start_s == 2.0  # moves 3 s after time 0, less the margin
    np.testing.assert_array_equal(recording.reference.scored, recording.position.t_s >= 3.0)
    assert RtklibDrive(folder, min_speed_mps=0.0, **PLAIN).load(0).reference.scored.all()
    assert RtklibDrive(folder, rest_s=1.5, **PLAIN).load(0).static_start_s == 1.5


def test_only_accepted_fixes_are_used(tmp_path):
    folder = write_drive(tmp_path, quality=5)
    with pytest.raises(RecordingError, match="has no fix with Q in"):
        RtklibDrive(folder, accepted_quality=(4.0,), **PLAIN).load(0)
    recording = RtklibDrive(folder, accepted_quality=(5.0,), **PLAIN).load(0)
    assert len(recording.position.t_s) == len(recording.velocity.t_s) == len(recording.reference.t_s) == 16


def test_moving_from_the_start_says_what_to_switch_off(tmp_path):
    folder = write_drive(tmp_path, moves_at=1.0)
    with pytest.raises(RecordingError, match="remove_gyro_bias"):
        RtklibDrive(folder, **PLAIN).load(0)
    recording = RtklibDrive(folder, remove_gyro_bias=False, scale_accel_to_gravity=False, **PLAIN).load(0)
    assert recording.static_start_s == 0.0


@pytest.mark.parametrize(
    ("own", "said"),
    [
        ({}, ["Mounting, time shift and latencies are the defaults, which were fitted on the public drive drive_0708"]),
        ({"imu_shift_s": 0.0}, ["Mounting and latencies are the defaults"]),
        ({"mounting_yaw_deg": 0.0, "imu_shift_s": 0.0, "velocity_latency_s": (0.0,) * 3}, ["Mounting is the default"]),
        ({"mounting_yaw_deg": 0.0, "mounting_pitch_deg": 0.0, "imu_shift_s": 0.0}, ["Latencies are the defaults"]),
        (PLAIN, []),
    ],
)
def test_defaults_that_were_fitted_on_the_public_drive_are_noted_and_nothing_is_said_of_this_one(tmp_path, own, said):
    notes = RtklibDrive(write_drive(tmp_path), **own).load(0).notes
    fitted = [note for note in notes if "fitted" in note]
    assert len(fitted) == len(said)
    assert all(note.startswith(start) for note, start in zip(fitted, said, strict=True))
    assert not [note for note in notes if "this same drive" in note]


@pytest.mark.parametrize(
    ("datum", "said"),
    [
        ("", "does not state if heights are above"),
        ("% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n", "Heights are above mean sea level"),
        ("% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix)\n", ""),
    ],
)
def test_heights_are_above_what_the_header_says(tmp_path, datum, said):
    folder = write_drive(tmp_path)
    (tmp_path / "a.pos").write_text(datum + (tmp_path / "a.pos").read_text())
    heights = [note for note in RtklibDrive(folder, **PLAIN).load(0).notes if "eights" in note]
    assert [said in note for note in heights] == ([True] if said else [])


def test_a_last_fix_that_was_cut_off_is_dropped_and_repeated_samples_are_counted(tmp_path):
    folder = write_drive(tmp_path)
    (tmp_path / "a.pos").write_text((tmp_path / "a.pos").read_text()[:-40])
    recording = RtklibDrive(folder, **PLAIN).load(0)
    assert len(recording.position.t_s) == 16
    assert "a.pos: the last row is truncated: 1 dropped." in recording.notes
    rows = [f"0,{0.001 * (k // 2)},1,1,2,3,{5000 + 10 * k}" for k in range(701)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    recording = RtklibDrive(folder, **PLAIN).load(0)
    assert (
        "350 of 701 IMU samples (50%) repeat all values of the previous sample: they contain no new measurement."
        in (recording.notes)
    )


@pytest.mark.parametrize("missing", ["a.pos", "a.csv", "a.csv.tag"])
def test_a_missing_file_is_one_sentence(tmp_path, missing):
    folder = write_drive(tmp_path)
    (tmp_path / missing).unlink()
    with pytest.raises(
        RecordingError, match=missing if missing == "a.csv.tag" else rf"no file .*\*\.{missing[2:]}; correct"
    ):
        RtklibDrive(folder).load(0)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("accel_unit", "mg", "There is no accel_unit 'mg'"),
        ("gyro_unit", "deg", "Did you mean 'deg/s'"),
        ("imu_axis_signs", (1.0, 0.0, 1.0), "give 1 or -1"),
        ("velocity_latency_s", (0.1,), "velocity_latency_s has 1 entries, .*; it must have 3"),
        ("imu_axes", ("x", "y", "-z"), "is left-handed"),
    ],
)
def test_parameters_are_checked(field, value, said):
    with pytest.raises(PluginError, match=said):
        RtklibDrive("somewhere", **{field: value})


def test_it_is_a_plugin_and_needs_a_folder_or_what_was_fetched(tmp_path, monkeypatch):
    folder = write_drive(tmp_path)
    dataset = plugins.create("dataset", {"name": "rtklib", "folder": folder, "imu_shift_s": -0.1})
    assert dataset == RtklibDrive(folder, imu_shift_s=-0.1)
    monkeypatch.setenv("JERKBENCH_DATA", str(tmp_path))
    with pytest.raises(RecordingError, match="fetch rtklib_drive_0708"):
        plugins.create("dataset", {"name": "rtklib"}).load(0)
    (tmp_path / "rtklib_drive_0708").mkdir()
    write_drive(tmp_path / "rtklib_drive_0708")
    assert plugins.create("dataset", {"name": "rtklib"}).load(0).name == "rtklib_drive_0708"
    dataset = RtklibDrive(write_drive(tmp_path))
    seen = {dataset.fingerprint()}
    for name in ("a.pos", "a.csv", "a.csv.tag"):
        with (tmp_path / name).open("ab") as file:
            file.write(b"\n")
        seen.add(dataset.fingerprint())
    assert len(seen) == 4


@needs_drive
def test_the_real_drive_has_the_published_facts():
    recording = RtklibDrive(str(DRIVE)).load(0)
    stamps = recording.position.t_s
    assert len(stamps) == len(recording.reference.t_s) == 2197
    assert recording.imu.t_s[-1] == pytest.approx(548.731, abs=1e-6)
    assert stamps[0] == pytest.approx(0.2 - 3.355, abs=1e-6)  # 3.355 s before the IMU's stamp, which is .2 s late
    assert recording.start_utc == datetime(2025, 7, 8, 19, 34, 3, 654000, tzinfo=UTC)
    assert recording.static_start_s == pytest.approx(34, abs=1)
    assert len(RtklibDrive(str(DRIVE), accepted_quality=(1.0,)).load(0).position.t_s) == 2189
    imu = RtklibDrive(str(DRIVE), remove_gyro_bias=False, scale_accel_to_gravity=False).load(0).imu
    rest = imu.t_s < 30
    np.testing.assert_allclose(imu.accel_mps2[rest].mean(axis=0), [-0.01, -0.20, 9.93], atol=0.01)
    assert np.linalg.norm(imu.accel_mps2[rest], axis=1).mean() == pytest.approx(9.934, abs=0.001)
    assert np.degrees(imu.gyro_radps[rest, 2].mean()) == pytest.approx(0.17, abs=0.005)


@needs_drive
def test_the_real_velocity_agrees_best_with_the_positions_at_its_own_times():
    from scipy.interpolate import CubicSpline

    recording = RtklibDrive(str(DRIVE)).load(0)
    slope = CubicSpline(recording.position.t_s, recording.position.enu_m).derivative()
    for axis in range(3):
        rows = np.isfinite(recording.velocity.mps[:, axis]) & (recording.velocity.t_s > 40)
        t_s, mps = recording.velocity.t_s[rows], recording.velocity.mps[rows, axis]
        errors = {lag: np.std(slope(t_s + lag)[:, axis] - mps) for lag in (-0.1, -0.05, 0.0, 0.05, 0.1)}
        assert min(errors, key=errors.get) == 0.0


def test_a_fix_that_leaps_is_dropped_and_said(tmp_path):
    folder = write_drive(tmp_path)
    lines = (tmp_path / "a.pos").read_text().splitlines()
    lines[1] = lines[1].replace(" 45.0 ", " 75.0 ")  # the first: ENU begins at the second then
    (tmp_path / "a.pos").write_text("\n".join(lines) + "\n")
    recording = RtklibDrive(folder, **PLAIN).load(0)
    assert any(
        "1 of 17 rows have a position more than 50 m from its neighbours: dropped." in note for note in recording.notes
    )
    assert (len(recording.position.t_s), recording.origin.latitude_deg) == (16, 45.0)
    assert np.abs(recording.reference.enu_m).max() < 10


def test_without_velocities_the_fixes_tell_the_speed(tmp_path):
    folder = write_drive(tmp_path)
    header, *rows = (tmp_path / "a.pos").read_text().splitlines()
    lines = [" ".join(header.split()[:15]), *(" ".join(row.split()[:15]) for row in rows)]
    (tmp_path / "a.pos").write_text("\n".join(lines) + "\n")
    recording = RtklibDrive(folder, **PLAIN).load(0)
    assert recording.velocity is None
    assert recording.static_start_s == 2.0
    assert recording.reference.scored.tolist() == [False] * 8 + [True] * 9
