import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pandas as pd
import pytest

from commands import verb
from jerkbench.errors import RecordingError
from jerkbench.io.writing import recording_table, write_kml, write_table, write_tum
from jerkbench.plugins.samples import small_recording
from jerkbench.recording import Velocity

EARTH = (6378137.0, 0.00669437999014)


@pytest.fixture(scope="module")
def recording():
    return small_recording()


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


def test_ned_turns_everything_that_is_in_the_navigation_frame(recording):
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


def test_a_velocity_in_the_body_stays_there(recording):
    body = Velocity(recording.velocity.t_s, recording.velocity.mps, recording.velocity.covariance_m2ps2, "body")
    table = recording_table(dataclasses.replace(recording, velocity=body), "ned")
    np.testing.assert_array_equal(table["velocity_left_mps"].dropna(), recording.velocity.mps[:, 1])


def test_geodetic_positions_lie_where_they_should(recording):
    table = recording_table(recording, "geodetic")
    first, last = at(table, 5.0), at(table, 15.0)
    a, e2 = EARTH
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


def test_tum_is_what_the_field_reads(tmp_path, recording):
    from scipy.spatial.transform import Rotation

    write_tum(recording, tmp_path / "a.tum")
    rows = np.loadtxt(tmp_path / "a.tum")
    np.testing.assert_allclose(rows[:, 0], recording.reference.t_s, atol=1e-9)
    np.testing.assert_allclose(rows[:, 1:4], recording.reference.enu_m, rtol=1e-8, atol=1e-8)
    yaw = Rotation.from_quat(rows[:, 4:]).as_euler("ZYX")[:, 0]
    np.testing.assert_allclose(yaw, recording.reference.euler_rad[:, 2], atol=1e-7)
    write_tum(recording, tmp_path / "b.tum", "position")
    assert len(np.loadtxt(tmp_path / "b.tum")) == len(recording.position.t_s) - 1


def test_kml_is_a_line_on_the_ellipsoid(tmp_path, recording):
    write_kml(recording, tmp_path / "a.kml")
    space = "{http://www.opengis.net/kml/2.2}"
    text = ET.parse(tmp_path / "a.kml").getroot().find(f".//{space}coordinates").text  # noqa: S314 - our own
    places = np.array([[float(value) for value in one.split(",")] for one in text.split()])
    assert len(places) == len(recording.reference.t_s)
    np.testing.assert_allclose(places[0], [11.0, 48.0, 500.0], atol=1e-9)
    with pytest.raises(RecordingError, match="KML needs one"):
        write_kml(dataclasses.replace(recording, origin=None), tmp_path / "b.kml")


def test_the_verb_converts_and_never_overwrites(tmp_path):
    words = ("data", "convert", "field", "a.mcap", "--set", "duration_s=12")
    done = verb(*words, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "a.mcap: field as ROS 2 bag, mcap\n"), done.stderr
    done = verb("data", "convert", "a.mcap", "b.csv", "--coordinates", "geodetic", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "position_latitude_deg" in (tmp_path / "b.csv").read_text().splitlines()[0]
    again = verb(*words, cwd=tmp_path)
    assert (again.returncode, again.stderr) == (
        2,
        "jerkbench: a.mcap is there already; delete it or give another name.\n",
    )
    wrong = verb("data", "convert", "a.mcap", "b.kmz", cwd=tmp_path)
    assert "Did you mean '.kml'?" in wrong.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "b.csv"]
