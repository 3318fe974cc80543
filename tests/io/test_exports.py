"""A recording as methods from elsewhere get it: nothing of the reference, and each format in its own frames."""

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pandas as pd
import pytest
from pymap3d import enu2geodetic

from commands import verb
from jerkbench.errors import RecordingError
from jerkbench.io.recording_folder import input_table, write_kf_gins, write_pyins
from jerkbench.plugins.samples import small_recording, true_attitude

FRD = np.array([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def recording():
    return replace(small_recording(), start_utc=datetime(2024, 5, 14, 14, tzinfo=UTC))


def places(recording, enu_m):
    origin = recording.origin
    return np.column_stack(enu2geodetic(*enu_m.T, origin.latitude_deg, origin.longitude_deg, origin.height_m))


def test_the_table_has_every_measurement_and_nothing_of_the_reference(recording):
    attitude = true_attitude(recording)
    table = input_table(recording, attitude)

    assert not [name for name in table if name.startswith("reference")]
    np.testing.assert_allclose(table["t_s"][table["evaluated"] == 1], recording.reference.t_s, atol=1e-9)
    fixes = table.dropna(subset="position_east_m")
    np.testing.assert_array_equal(fixes["position_east_m"], recording.position.enu_m[:, 0])
    inputs = table.dropna(subset="attitude_accel_up_mps2")
    np.testing.assert_allclose(inputs["t_s"], attitude.t_s, atol=1e-9)
    np.testing.assert_array_equal(inputs["attitude_yaw_rad"], attitude.euler_rad[:, 2])
    np.testing.assert_array_equal(inputs["attitude_accel_up_mps2"], attitude.accel_enu_mps2[:, 2])


def test_kf_gins_gets_increments_in_frd_and_fixes_in_degrees(tmp_path, recording):
    write_kf_gins(recording, true_attitude(recording), tmp_path)
    imu, gnss = np.loadtxt(tmp_path / "imu.txt"), np.loadtxt(tmp_path / "gnss.txt")

    second_of_week = 2 * 86400 + 14 * 3600 + 18  # a Tuesday, and GPS time is 18 s ahead of UTC
    np.testing.assert_allclose(imu[:, 0], second_of_week + recording.imu.t_s, atol=1e-8)
    np.testing.assert_allclose(imu[1:, 1:4], recording.imu.gyro_radps[1:] * FRD * 0.02, atol=1e-12)
    np.testing.assert_allclose(imu[1:, 4:], recording.imu.accel_mps2[1:] * FRD * 0.02, atol=1e-12)
    whole = np.isfinite(recording.position.enu_m).all(axis=1)
    wanted = places(recording, recording.position.enu_m[whole])
    np.testing.assert_allclose(gnss[:, 1:3], wanted[:, :2], atol=1e-10)
    np.testing.assert_allclose(gnss[:, 3], wanted[:, 2], atol=1e-4)
    np.testing.assert_allclose(gnss[:, 4:], 0.02, atol=1e-9)


def test_kf_gins_begins_at_the_first_fix_as_the_vehicle_stands(tmp_path, recording):
    write_kf_gins(recording, true_attitude(recording), tmp_path)
    settings = dict(line.split(":", 1) for line in (tmp_path / "kf-gins.yaml").read_text().splitlines())

    start_s = float(settings["starttime"].split("#")[0])
    assert start_s == pytest.approx(223218 + recording.position.t_s[0], abs=1e-6)
    attitude_deg = json.loads(settings["initatt"].split("#")[0])
    np.testing.assert_allclose(attitude_deg, [0.0, 0.0, 90.0], atol=1e-6)  # level, and the body's x is east


def test_pyins_gets_its_own_names_in_ned_and_frd(tmp_path, recording):
    write_pyins(recording, true_attitude(recording), tmp_path)
    tables = {path.stem: pd.read_csv(path, index_col=0) for path in tmp_path.glob("*.csv")}

    assert list(tables["imu"]) == ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    np.testing.assert_allclose(tables["imu"].iloc[:, :3], recording.imu.gyro_radps * FRD, atol=1e-12)
    np.testing.assert_allclose(tables["imu"].iloc[:, 3:], recording.imu.accel_mps2 * FRD, atol=1e-12)
    east, north, up = recording.velocity.mps.T
    np.testing.assert_allclose(tables["velocity"][["VN", "VE", "VD"]], np.column_stack([north, east, -up]), atol=1e-12)
    whole = np.isfinite(recording.position.enu_m).all(axis=1)
    wanted = places(recording, recording.position.enu_m[whole])
    np.testing.assert_allclose(tables["position"][["lat", "lon", "alt"]][whole], wanted, atol=1e-9)
    np.testing.assert_allclose(tables["velocity"]["sd"], 0.03)
    heading_deg = 90.0 - np.degrees(recording.reference.euler_rad[:, 2])
    turned = np.radians(tables["attitude"]["heading"].to_numpy() - heading_deg)
    np.testing.assert_allclose(np.cos(turned), 1.0, atol=1e-12)


def test_a_recording_without_an_origin_is_refused_with_a_sentence(tmp_path, recording):
    for write in (write_kf_gins, write_pyins):
        with pytest.raises(RecordingError, match="origin"):
            write(replace(recording, origin=None), true_attitude(recording), tmp_path)


def test_the_verb_writes_a_folder_for_each_seed(tmp_path):
    scenario = ["dataset=field", "dataset.duration_s=12", "disturbance=imu_bias", "seeds=2"]
    done = verb("data", "export", "drive", *scenario, "--format", "csv", "mcap", cwd=tmp_path)
    assert done.returncode == 0, done.stderr

    assert {path.name for path in (tmp_path / "drive" / "1").iterdir()} == {
        "recording.csv",
        "recording.json",
        "recording.mcap",
        "reference.csv",
    }
    told = json.loads((tmp_path / "drive" / "1" / "recording.json").read_text())
    assert told["streams"]["imu"]["rate_hz"] == 100.0
    assert told["streams"]["velocity"]["frame"] == "enu"
    assert told["origin"]["latitude_deg"] == 42.03
    assert told["made_of"]["seed"] == 1
    assert told["made_of"]["disturbance"][0]["name"] == "imu_bias"
    first, second = (pd.read_csv(tmp_path / "drive" / seed / "recording.csv") for seed in "01")
    assert not first["accel_up_mps2"].equals(second["accel_up_mps2"])
    assert "is there already" in verb("data", "export", "drive", *scenario, cwd=tmp_path).stderr
    done = verb("data", "export", "blind", *scenario, "--without-reference", cwd=tmp_path)
    assert not (tmp_path / "blind" / "0" / "reference.csv").exists()
    assert "Did you mean 'kf_gins'" in verb("data", "export", "x", "--format", "kfgins", cwd=tmp_path).stderr
