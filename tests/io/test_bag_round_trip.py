"""A recording written as a bag and read back: the same recording, the same table."""

import dataclasses

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import jerkbench
from bag_maker import fixposition
from jerkbench.datasets.field import FieldWhite
from jerkbench.datasets.rosbag import RosBag
from jerkbench.errors import RecordingError
from jerkbench.io.bag_writing import write_bag
from jerkbench.plugins.samples import small_recording
from jerkbench.recording import Reference, Velocity

FIELD = {"duration_s": 20.0, "stand_s": 3.0}


def same(one, other, stream, *names, atol=1e-8):
    for name in names:
        value, expected = (getattr(getattr(recording, stream), name) for recording in (one, other))
        np.testing.assert_allclose(value, expected, rtol=1e-9, atol=atol)


@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap"])
def test_a_simulated_field_comes_back(tmp_path, suffix):
    field = FieldWhite(**FIELD).load(3)
    write_bag(field, tmp_path / f"a{suffix}")
    back = fixposition(str(tmp_path / f"a{suffix}")).load(0)
    same(back, field, "imu", "t_s", "accel_mps2", "gyro_radps")
    same(back, field, "position", "t_s", "enu_m", "covariance_m2")
    same(back, field, "velocity", "t_s", "mps", "covariance_m2ps2")
    same(back, field, "heading", "t_s", "yaw_rad", "sigma_rad")
    same(back, field, "reference", "t_s", "enu_m", "velocity_mps", "euler_rad")
    assert (back.name, back.start_utc, back.static_start_s) == (field.name, field.start_utc, field.static_start_s)
    assert (back.reference.source, back.reference.independent) == ("simulated truth", True)
    assert back.origin == field.origin
    assert back.notes == ()


@pytest.mark.parametrize(
    ("dataset", "suffix"), [("fixposition", ".bag"), ("rosbag", ".db3"), ("fixposition", ".mcap"), ("rosbag", ".mcap")]
)
def test_the_table_is_the_same(tmp_path, dataset, suffix):
    write_bag(FieldWhite(**FIELD).load(0), tmp_path / f"a{suffix}")
    parts = {"filter": "jerk", "adaptation": "mtf", "attitude": "field", "disturbance": "gnss_outage", "seeds": 1}
    parts["disturbance"] = [{"name": "gnss_outage", "windows_s": [[8, 12]]}]
    (simulated,) = jerkbench.run(dataset={"name": "field_white", **FIELD}, **parts).to_dict("records")
    (read,) = jerkbench.run(dataset={"name": dataset, "file": str(tmp_path / f"a{suffix}")}, **parts).to_dict("records")
    numbers = [key for key, value in simulated.items() if isinstance(value, float)]
    assert "position_rmse_m" in numbers
    assert len(numbers) > 10
    for key in numbers:
        assert read[key] == pytest.approx(simulated[key], rel=1e-6, abs=1e-9, nan_ok=True), key


def test_covariances_keep_their_axes(tmp_path):
    field = FieldWhite(**FIELD).load(0)
    skew = np.array([[4e-4, 1e-4, -2e-4], [1e-4, 1e-4, 0], [-2e-4, 0, 9e-4]])
    position = dataclasses.replace(field.position, covariance_m2=np.tile(skew, (len(field.position.t_s), 1, 1)))
    write_bag(dataclasses.replace(field, position=position), tmp_path / "a.bag")
    for dataset in (fixposition, RosBag):
        np.testing.assert_allclose(dataset(str(tmp_path / "a.bag")).load(0).position.covariance_m2[5], skew, rtol=1e-12)
    with AnyReader([tmp_path / "a.bag"]) as reader:
        connections = [c for c in reader.connections if c.topic == "/fixposition/gnss1"]
        connection, _, raw = next(reader.messages(connections))
        said = reader.deserialize(raw, connection.msgtype).position_covariance.reshape(3, 3)
    np.testing.assert_array_equal(said, [[1e-4, 1e-4, 0], [1e-4, 4e-4, -2e-4], [0, -2e-4, 9e-4]])  # north, east, up


def test_what_is_partly_there_comes_back_so(tmp_path):
    """An axis that is NaN, a speed along the course, a reference with less than everything."""
    small = small_recording()
    t_s = small.velocity.t_s
    half = small.velocity.mps.copy()
    half[::2, :2], half[1::2, 2] = np.nan, np.nan
    references = [
        Reference(small.reference.t_s, "fixes", independent=False, enu_m=small.reference.enu_m),
        Reference(
            small.reference.t_s,
            "poses",
            independent=True,
            enu_m=small.reference.enu_m,
            euler_rad=small.reference.euler_rad,
        ),
        Reference(small.reference.t_s, "none", independent=False),
    ]
    velocities = [
        dataclasses.replace(small.velocity, mps=half),
        Velocity.along_course(t_s, np.hypot(*small.velocity.mps[:, :2].T), 0.1),
        Velocity.along_course(t_s, np.hypot(*small.velocity.mps[:, :2].T), 0.1, 0.3),
    ]
    for k, (reference, velocity) in enumerate(zip(references, velocities, strict=True)):
        given = dataclasses.replace(small, reference=reference, velocity=velocity, heading=None)
        said = write_bag(given, tmp_path / f"{k}.bag")
        assert "1 of 120 fixes lack an axis" in said[0]
        back = RosBag(str(tmp_path / f"{k}.bag")).load(0)
        assert back.velocity.frame == velocity.frame
        same(back, given, "velocity", "t_s", "mps")
        assert back.reference.empty == reference.empty
        if not reference.empty:
            same(back, given, "reference", "t_s", "enu_m")
            assert back.reference.velocity_mps is None
            assert (back.reference.source, back.reference.independent) == (reference.source, reference.independent)
        assert len(back.position.t_s) == len(small.position.t_s) - 1  # the fix without height is no NavSatFix
    np.testing.assert_array_equal(back.outages_s, small.outages_s)


def test_what_has_no_place_in_a_bag_is_said_and_a_recording_without_origin_refused(tmp_path):
    field = FieldWhite(**FIELD).load(0)
    assert write_bag(field, tmp_path / "a.bag") == []
    position = dataclasses.replace(field.position, true_covariance_m2=field.position.covariance_m2)
    known = np.where(np.arange(2000)[:, None] < 1990, field.reference.euler_rad, np.nan)
    reference = dataclasses.replace(field.reference, euler_rad=known, scored=np.arange(2000) > 5)
    said = write_bag(dataclasses.replace(field, position=position, reference=reference), tmp_path / "b.bag")
    begins = [
        "10 of 2000 rows of the reference",
        "A bag cannot store which rows",
        "A bag cannot store true covariances",
    ]
    assert [sentence.startswith(begin) for sentence, begin in zip(said, begins, strict=True)] == [True] * 3
    with pytest.raises(RecordingError, match="origin"):
        write_bag(dataclasses.replace(small_recording(), origin=None), tmp_path / "c.bag")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bag", "b.bag"]
