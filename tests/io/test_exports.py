"""A recording as methods from elsewhere get it: nothing of the reference, and each format in its own frames."""

import dataclasses
import json
import os
import runpy
import xml.etree.ElementTree as ET
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest
from pymap3d import enu2geodetic

from commands import verb
from jerkbench.errors import RecordingError
from jerkbench.io.writing import input_table, recording_table, write_gpx, write_recording, write_table, write_tum
from jerkbench.plugins.samples import small_recording, true_attitude
from jerkbench.recording import Velocity

EXAMPLES = Path(__file__).parents[2] / "examples" / "any_language"
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


@pytest.fixture
def converted(tmp_path, recording):
    """What an example of docs/any_language.md makes of the exported recording."""
    (path, _) = write_recording(recording, true_attitude(recording), tmp_path, ["csv"], {})

    def call(script, function, *arguments):
        with patch.dict(os.environ):  # the example for pyins sets NUMBA_DISABLE_JIT
            return runpy.run_path(str(EXAMPLES / script))[function](path, *arguments)

    return call


def test_kf_gins_gets_increments_in_frd_fixes_in_degrees_and_begins_at_the_first_fix(tmp_path, recording, converted):
    converted("kf_gins.py", "write_input", tmp_path)
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
    converted("kf_gins.py", "write_input", tmp_path)
    settings = dict(line.split(":", 1) for line in (tmp_path / "kf-gins.yaml").read_text().splitlines())
    start_s = float(settings["starttime"].split("#")[0])
    assert start_s == pytest.approx(223218 + recording.position.t_s[0], abs=1e-6)
    attitude_deg = json.loads(settings["initatt"].split("#")[0])
    np.testing.assert_allclose(attitude_deg, [0.0, 0.0, 90.0], atol=1e-6)  # level, and the body's x is east


def test_pyins_gets_its_own_names_in_ned_and_frd(recording, converted):
    pytest.importorskip("pyins", reason="python-ins is not there; pip install 'jerkbench[anchors]'")
    tables = converted("pyins_filter.py", "tables_of")

    assert list(tables["imu"]) == ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    np.testing.assert_allclose(tables["imu"].iloc[:, :3], recording.imu.gyro_radps * FRD, atol=1e-12)
    np.testing.assert_allclose(tables["imu"].iloc[:, 3:], recording.imu.accel_mps2 * FRD, atol=1e-12)
    east, north, up = recording.velocity.mps.T
    np.testing.assert_allclose(tables["velocity"][["VN", "VE", "VD"]], np.column_stack([north, east, -up]), atol=1e-12)
    whole = np.isfinite(recording.position.enu_m).all(axis=1)
    wanted = places(recording, recording.position.enu_m[whole])
    np.testing.assert_allclose(tables["position"][["lat", "lon", "alt"]], wanted, atol=1e-9)
    np.testing.assert_allclose(tables["velocity"][["sd_north", "sd_east", "sd_down"]], 0.03)
    heading_deg = 90.0 - np.degrees(recording.reference.euler_rad[:, 2])
    turned = np.radians(tables["attitude"]["heading"].to_numpy() - heading_deg)
    np.testing.assert_allclose(np.cos(turned), 1.0, atol=1e-12)


def test_the_verb_writes_a_folder_for_each_seed(tmp_path):
    scenario = ["dataset=field", "dataset.duration_s=12", "disturbance=imu_bias", "seeds=2"]
    done = verb("data", "export", "drive", *scenario, "--format", "csv", "mcap", cwd=tmp_path)
    assert done.returncode == 0, done.stderr

    names = sorted(path.name for path in (tmp_path / "drive" / "1").iterdir())
    assert names == ["recording.csv", "recording.json", "recording.mcap", "reference.csv"]
    told = json.loads((tmp_path / "drive" / "1" / "recording.json").read_text())
    assert told["streams"]["imu"]["rate_hz"] == 100.0
    assert told["streams"]["velocity"]["frame"] == "enu"
    assert told["origin"]["latitude_deg"] == 42.03
    assert told["made_of"]["seed"] == 1
    assert told["made_of"]["disturbance"][0]["name"] == "imu_bias"
    first, second = (pd.read_csv(tmp_path / "drive" / seed / "recording.csv") for seed in "01")
    assert not first["accel_up_mps2"].equals(second["accel_up_mps2"])
    assert "already exists" in verb("data", "export", "drive", *scenario, cwd=tmp_path).stderr
    done = verb("data", "export", "blind", *scenario, "--without-reference", cwd=tmp_path)
    assert not (tmp_path / "blind" / "0" / "reference.csv").exists()
    assert "Did you mean 'parquet'" in verb("data", "export", "x", "--format", "parket", cwd=tmp_path).stderr


def at(table, t_s):
    return table.loc[(table["t_s"] - t_s).abs().idxmin()]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_table_has_every_stream_at_its_stamps(tmp_path, recording, suffix):
    write_table(recording, tmp_path / f"a{suffix}")
    table = pd.read_csv(tmp_path / "a.csv") if suffix == ".csv" else pd.read_parquet(tmp_path / "a.parquet")
    rows = table.dropna(subset="accel_up_mps2")
    np.testing.assert_allclose(rows["t_s"], recording.imu.t_s, atol=1e-9)
    np.testing.assert_allclose(rows["accel_up_mps2"], recording.imu.accel_mps2[:, 2], rtol=1e-9)
    fixes = table.dropna(subset="position_east_m")
    np.testing.assert_allclose(fixes["t_s"], recording.position.t_s, atol=1e-9)
    assert np.isnan(recording.position.enu_m).sum() == 1
    np.testing.assert_allclose(fixes["position_north_m"], recording.position.enu_m[:, 1], rtol=1e-9)
    assert table["position_up_m"].notna().sum() == len(recording.position.t_s) - 1  # one height was not measured
    np.testing.assert_allclose(table["reference_yaw_rad"].dropna(), recording.reference.euler_rad[:, 2], rtol=1e-9)
    np.testing.assert_allclose(table["heading_sigma_rad"].dropna(), 0.01)


def test_ned_turns_the_navigation_frame_and_not_the_body_and_geodetic_positions_lie_where_they_should(recording):
    skew = np.tile(np.array([[4.0, 1, 2], [1, 5, 3], [2, 3, 6]]), (len(recording.position.t_s), 1, 1))
    position = dataclasses.replace(recording.position, covariance_m2=skew)
    given = dataclasses.replace(recording, position=position)
    enu, ned = at(recording_table(given), 15.0), at(recording_table(given, "ned"), 15.0)
    for stream in ("position", "reference"):
        assert ned[f"{stream}_north_m"] == enu[f"{stream}_north_m"]
        assert ned[f"{stream}_down_m"] == -enu[f"{stream}_up_m"]
    assert ned["velocity_down_mps"] == -enu["velocity_up_mps"]
    variances = [ned[f"position_variance_{k}_m2"] for k in ("11", "22", "33", "12", "13", "23")]
    assert variances == [5, 4, 6, 1, -3, -2]  # north, east, down
    assert ned["accel_up_mps2"] == enu["accel_up_mps2"]
    body = Velocity(recording.velocity.t_s, recording.velocity.mps, recording.velocity.covariance_m2ps2, "body")
    table = recording_table(dataclasses.replace(recording, velocity=body), "ned")
    np.testing.assert_array_equal(table["velocity_left_mps"].dropna(), recording.velocity.mps[:, 1])
    table = recording_table(recording, "geodetic")
    first, last = at(table, 5.0), at(table, 15.0)
    a, e2 = 6378137.0, 0.00669437999014
    lat = np.radians(48.0)
    w = np.sqrt(1 - e2 * np.sin(lat) ** 2)
    meridian, normal = a * (1 - e2) / w**3 + 500, a / w + 500
    north = np.radians(last["reference_latitude_deg"] - first["reference_latitude_deg"]) * meridian
    east = np.radians(last["reference_longitude_deg"] - first["reference_longitude_deg"]) * normal * np.cos(lat)
    rows = np.searchsorted(recording.reference.t_s, [5.0, 15.0])
    moved = np.diff(recording.reference.enu_m[rows], axis=0)[0]
    np.testing.assert_allclose([east, north], moved[:2], atol=1e-4)
    with pytest.raises(RecordingError, match="choose --coordinates enu or ned"):
        recording_table(dataclasses.replace(recording, origin=None), "geodetic")


def test_tum_is_what_the_field_reads_and_gpx_is_a_line_on_the_ellipsoid(tmp_path, recording):
    from scipy.spatial.transform import Rotation

    recording = replace(recording, start_utc=None)  # seconds since its start
    write_tum(recording, tmp_path / "a.tum")
    rows = np.loadtxt(tmp_path / "a.tum")
    np.testing.assert_allclose(rows[:, 0], recording.reference.t_s, atol=1e-9)
    np.testing.assert_allclose(rows[:, 1:4], recording.reference.enu_m, rtol=1e-8, atol=1e-8)
    yaw = Rotation.from_quat(rows[:, 4:]).as_euler("ZYX")[:, 0]
    np.testing.assert_allclose(yaw, recording.reference.euler_rad[:, 2], atol=1e-7)
    write_tum(recording, tmp_path / "b.tum", "position")
    assert len(np.loadtxt(tmp_path / "b.tum")) == len(recording.position.t_s) - 1
    write_gpx(recording, tmp_path / "a.gpx")
    points = ET.parse(tmp_path / "a.gpx").getroot().findall(".//{http://www.topografix.com/GPX/1/1}trkpt")  # noqa: S314 - our own
    places = np.array([[float(point.get("lon")), float(point.get("lat")), float(point[0].text)] for point in points])
    assert len(places) == len(recording.reference.t_s)
    np.testing.assert_allclose(places[0], [11.0, 48.0, 500.0], atol=1e-9)
    with pytest.raises(RecordingError, match="which GPX needs"):
        write_gpx(dataclasses.replace(recording, origin=None), tmp_path / "b.gpx")


def test_the_verb_converts_and_never_overwrites(tmp_path):
    words = ("data", "convert", "field", "a.mcap", "--set", "duration_s=12")
    done = verb(*words, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "a.mcap: field as ROS 2 bag, mcap\n"), done.stderr
    done = verb("data", "convert", "a.mcap", "b.csv", "--coordinates", "geodetic", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "position_latitude_deg" in (tmp_path / "b.csv").read_text().splitlines()[0]
    again, there = verb(*words, cwd=tmp_path), "a.mcap already exists; delete a.mcap, or give another name."
    assert (again.returncode, again.stderr) == (2, f"jerkbench: {there}\n")
    wrong = verb("data", "convert", "a.mcap", "b.gpz", cwd=tmp_path)
    assert "Did you mean '.gpx'?" in wrong.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "b.csv"]
