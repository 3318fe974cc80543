"""Recordings of fixes alone: what runs over them, from fix to fix, and what says that it cannot."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from jerkbench import plugins
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.table import Tables
from jerkbench.disturbances.imu import ImuBias
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import RecordingError
from jerkbench.estimate import no_attitude
from jerkbench.filters.kinematic import ConstantVelocity
from jerkbench.inspection.facts import facts_text
from jerkbench.jobs.rows import attitude_of
from jerkbench.recording import Position, Recording, Reference, Velocity
from jerkbench.timeline import build_timeline

SIGMA_M = 0.5


def fixes_alone(n=60, velocity=False):
    """A curve at some 8 m/s, 1 Hz, a gap in the middle; the reference stands between the fixes too."""
    t_s = np.delete(np.arange(float(n)), slice(20, 26))
    draw = np.random.default_rng(1)

    def place(t):
        return np.column_stack([80 * np.sin(0.1 * t), 80 * np.cos(0.1 * t), 0.1 * t])

    covariance = np.tile(SIGMA_M**2 * np.eye(3), (len(t_s), 1, 1))
    position = Position(t_s, place(t_s) + SIGMA_M * draw.normal(size=(len(t_s), 3)), covariance)
    at_s = np.arange(0.0, n - 0.75, 0.5)
    speeds = None
    if velocity:
        rate = np.column_stack([8 * np.cos(0.1 * t_s), -8 * np.sin(0.1 * t_s), np.full(len(t_s), 0.1)])
        speeds = Velocity(t_s, rate, 0.01 * np.tile(np.eye(3), (len(t_s), 1, 1)))
    reference = Reference(at_s, "a closed form", independent=True, enu_m=place(at_s))
    return Recording("curve", None, reference, position, speeds)


def test_the_steps_are_those_from_fix_to_fix_and_to_the_references_stamps():
    recording = fixes_alone()
    timeline = build_timeline(recording, no_attitude(recording.clock_s))
    events = np.union1d(recording.position.t_s, recording.reference.t_s)
    np.testing.assert_allclose(timeline.t_s, events[events <= 59.0], atol=1e-9)
    np.testing.assert_array_equal(timeline.accel_enu_mps2, 0.0)
    assert timeline.dt0_s == 1.0
    assert recording.duration_s == 59.0
    assert (timeline.update >= 0).sum() == len(recording.position.t_s) - 1


def test_constant_velocity_is_the_conditional_mean_of_its_own_prior():
    """Computed at once: cov(p(s), p(t)) of a random walk of the velocity that starts at 0 +- 10 m/s and a known fix."""
    recording, q = fixes_alone(12), 1.5
    timeline = build_timeline(recording, no_attitude(recording.clock_s))
    estimate = FilterpyEngine().run(timeline, ConstantVelocity(q), plugins.create("adaptation", {"name": "none"}))
    t, z = recording.position.t_s, recording.position.enu_m

    def covariance(s, u):
        """That of the places at s and u: start, first velocity, and the walk of the velocity twice integrated."""
        low, high = np.minimum(s, u), np.maximum(s, u)
        return SIGMA_M**2 + 100.0 * s * u + q**2 * (low**2 * high / 2 - low**3 / 6)

    prior = covariance(t[1:, None], t[None, 1:])
    gain = covariance(t[-1], t[None, 1:]) @ np.linalg.inv(prior + SIGMA_M**2 * np.eye(len(t) - 1))
    expected = z[0] + gain @ (z[1:] - z[0])
    (row,) = np.flatnonzero(recording.reference.t_s[estimate.index] == t[-1])
    np.testing.assert_allclose(estimate.position_m[row], expected[0], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [False, True])
@pytest.mark.parametrize("name", ["constant_velocity", "acceleration"])
def test_both_engines_agree_with_every_adaptation(name, velocity):
    recording = fixes_alone(30, velocity)
    timeline = build_timeline(recording, no_attitude(recording.clock_s))
    engines = [plugins.create("engine", {"name": engine}) for engine in ("filterpy", "compiled")]
    model = plugins.create("filter", {"name": name})
    for adaptation in plugins.names("adaptation"):
        rule = plugins.create("adaptation", {"name": adaptation})
        slow, fast = (engine.run(timeline, model, rule) for engine in engines)
        assert slow.failure == fast.failure, adaptation
        np.testing.assert_allclose(slow.position_m, fast.position_m, atol=1e-6, err_msg=adaptation)


def test_there_is_no_attitude_and_what_needs_an_imu_says_so():
    recording = fixes_alone()
    attitude = attitude_of(recording, Tilt())
    assert np.isnan(attitude.euler_rad).all()
    with pytest.raises(RecordingError, match="curve has no IMU"):
        ImuBias().apply(recording, 0)
    with pytest.raises(RecordingError, match="needs an IMU or at least 2 position fixes"):
        dataclasses.replace(recording, position=None)
    body = Velocity(recording.position.t_s, np.ones((54, 3)), np.tile(np.eye(3), (54, 1, 1)), "body")
    with pytest.raises(RecordingError, match="frame 'body'"):
        dataclasses.replace(recording, velocity=body)
    facts = facts_text(recording)
    assert "imu       none" in facts
    assert "no IMU: attitude, tilt and yaw do not apply" in facts


@pytest.fixture
def tables(tmp_path):
    recording = fixes_alone()
    names = ["t", "e", "n", "u"]
    for file, stream in (("fix.csv", recording.position), ("truth.csv", recording.reference)):
        rows = np.column_stack([stream.t_s + 1.7e9, stream.enu_m])
        pd.DataFrame(rows, columns=names).to_csv(tmp_path / file, index=False)
    return {
        "folder": str(tmp_path),
        "imu_file": "",
        "position_file": "fix.csv",
        "position_columns": ("e", "n", "u"),
        "position_frame": "enu",
        "reference_file": "truth.csv",
        "reference_position": ("e", "n", "u"),
    }


def test_a_table_without_an_imu_starts_with_its_first_fix(tables):
    recording = Tables(**tables).load(0)
    assert recording.imu is None
    np.testing.assert_allclose(recording.position.t_s, fixes_alone().position.t_s, atol=1e-6)
    assert recording.start_utc.timestamp() == pytest.approx(1.7e9)
    assert recording.notes == ("There is no IMU: attitude, tilt and yaw do not apply.",)


def test_a_sweep_leaves_out_filters_that_need_an_imu(tables, typed):
    texts = {key: f"[{','.join(value)}]" if isinstance(value, tuple) else value for key, value in tables.items()}
    words = [f"dataset.{key}={text}" for key, text in texts.items()]
    done = typed("run", "-m", "dataset=table", *words, "filter=constant_velocity,gnss_only,jerk")
    text = done.stdout + done.stderr
    assert "has no IMU, so the filter jerk cannot be used; possible filters: acceleration, constant_turn, " in text
    assert "constant_velocity" in done.stdout
    assert "There is no IMU: attitude, tilt and yaw do not apply." in done.stdout
