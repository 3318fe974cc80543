"""The reported R that a filter is told: that of a receiver which reports other covariances, and nothing else."""

import dataclasses

import numpy as np
import pytest

import jerkbench
from jerkbench.errors import PluginError
from jerkbench.r_scale import RScale, scale_of, with_r_scale
from jerkbench.recording import Velocity
from jerkbench.timeline import build_timeline, told_timeline
from synthetic import level_attitude, recording_at_rest

SCALE = RScale(position=4.0, velocity=0.25)
SHORT = {"name": "field", "duration_s": 12.0}


def noisy(**replaced):
    recording = recording_at_rest(duration_s=5.0, **replaced)
    rng = np.random.default_rng(1)
    p = recording.position
    return dataclasses.replace(
        recording, position=dataclasses.replace(p, enu_m=p.enu_m + 0.01 * rng.standard_normal(p.enu_m.shape))
    )


def test_covariances_are_scaled_and_nothing_else():
    recording = noisy()

    seen = with_r_scale(recording, SCALE)

    assert np.array_equal(seen.position.enu_m, recording.position.enu_m)
    assert seen.position.covariance_m2[0, 0, 0] == pytest.approx(4 * 0.01**2)
    assert seen.velocity.covariance_m2ps2[0, 0, 0] == pytest.approx(0.25 * 0.03**2)
    assert seen.imu is recording.imu
    assert seen.reference is recording.reference


def test_an_oracle_is_told_the_covariance_that_the_data_have():
    seen = with_r_scale(noisy(), SCALE)

    assert np.array_equal(seen.position.true_covariance_m2, noisy().position.covariance_m2)
    assert np.array_equal(seen.velocity.true_covariance_m2ps2, noisy().velocity.covariance_m2ps2)


def speed(recording):
    wheel = Velocity.along_course(recording.velocity.t_s, np.ones(len(recording.velocity.t_s)), 0.1)
    return dataclasses.replace(recording, velocity=wheel)


def along_the_body(recording):
    return dataclasses.replace(recording, velocity=dataclasses.replace(recording.velocity, frame="body"))


@pytest.mark.parametrize(
    "recording",
    [
        noisy(),
        noisy(velocity=None),
        speed(noisy()),
        along_the_body(noisy()),
        noisy(position_sigma_m=0.0011),
        noisy(position_sigma_m=0.0005),
    ],
    ids=["both", "position alone", "wheel", "body", "scaled below the floor", "reported below the floor"],
)
@pytest.mark.parametrize("scale", [SCALE, RScale(position=0.1), RScale(2.7, 0.3)])
def test_the_quick_way_makes_the_timeline_of_what_is_told(recording, scale):
    attitude = level_attitude(recording)
    whole = build_timeline(with_r_scale(recording, scale), attitude)
    before = build_timeline(recording, attitude)

    quick = told_timeline(before, recording, attitude, scale)

    assert quick.accel_enu_mps2 is before.accel_enu_mps2
    assert quick.measurements.z is before.measurements.z
    there = np.isfinite(before.measurements.z)
    pairs = there[:, :, None] & there[:, None, :]
    for name in ("R", "R_true"):
        quickly, wholly = (getattr(of.measurements, name)[pairs] for of in (quick, whole))
        np.testing.assert_array_equal(quickly, wholly)
    np.testing.assert_array_equal(quick.x0, whole.x0)
    np.testing.assert_array_equal(quick.P0, whole.P0)


@pytest.mark.parametrize("model", ["jerk", pytest.param("imm", marks=pytest.mark.slow)])
def test_both_ways_to_run_see_what_is_told_and_scale_the_nis_with_it(model):
    def run(engine, scale):
        return jerkbench.run(dataset=SHORT, filter=model, engine=engine, seeds=1, r_scale=scale).iloc[0]

    (fast, slow), plain = (run(engine, {"position": 9.0}) for engine in ("compiled", "filterpy")), run("compiled", None)

    assert fast["noise"] == "r_scale.position=9"
    assert plain["noise"] == "default"
    assert fast["position_rmse_m"] == pytest.approx(slow["position_rmse_m"], rel=1e-6)
    assert fast["position_rmse_m"] != pytest.approx(plain["position_rmse_m"], rel=1e-3)
    assert fast["anis_per_row"] == pytest.approx(slow["anis_per_row"], rel=1e-6)
    assert fast["anis_per_row"] < plain["anis_per_row"]


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_factor_without_sense_is_refused(value):
    with pytest.raises(PluginError, match=r"r_scale.velocity is .*positive number"):
        RScale(velocity=value)


WRONG = [float("inf"), "abc", [1.0], {"position": "2"}, {"position": True}, {3: 1.0}, {"positon": 2.0}]


@pytest.mark.parametrize("values", WRONG)
def test_what_is_no_pair_of_numbers_is_refused_with_a_sentence(values):
    with pytest.raises(PluginError, match=r"r_scale.*position"):
        scale_of(values)


def test_a_wrong_name_is_refused_in_a_run():
    with pytest.raises(PluginError, match=r"r_scale.*position"):
        jerkbench.run(dataset=SHORT, seeds=1, r_scale={"positon": 2.0})


def test_no_factors_leave_the_reported_covariances():
    assert scale_of(None) == scale_of({}) == RScale()
    assert scale_of({"position": 2}) == RScale(position=2.0)
