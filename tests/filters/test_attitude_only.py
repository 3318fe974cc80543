"""The filter that navigates nowhere, and what a sweep says of a data set without positions."""

import dataclasses

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.evaluation.evaluated_run import evaluate_run, run_status
from jerkbench.filters.attitude_only import AttitudeOnlyFilter
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.names import refusal
from jerkbench.plugins import create, names
from synthetic import level_attitude, recording_at_rest


def attitude_turning(recording):
    euler = np.zeros((len(recording.imu.t_s), 3))
    euler[:, 0] = recording.imu.t_s
    return dataclasses.replace(level_attitude(recording), euler_rad=euler)


def test_the_angles_are_the_last_ones_at_or_before_each_stamp():
    recording = recording_at_rest(10.0)
    stamps = np.array([0.001, 1.0, 2.005, 3.0, 11.0])
    reference = dataclasses.replace(
        recording.reference, t_s=stamps, enu_m=None, velocity_mps=None, euler_rad=np.zeros((5, 3)), scored=None
    )
    recording = dataclasses.replace(recording, reference=reference)
    estimate = AttitudeOnlyFilter().estimate(recording, attitude_turning(recording), NoAdaptation())

    assert estimate.index.tolist() == [1, 2, 3]  # before the first sample and after the last nothing is known
    np.testing.assert_allclose(estimate.euler_rad[:, 0], [1.0, 2.0, 3.0])
    assert np.isnan(estimate.position_m).all()


def test_it_goes_well_without_a_position_and_has_no_error_of_one():
    recording = recording_at_rest(10.0)
    estimate = AttitudeOnlyFilter().estimate(recording, level_attitude(recording), NoAdaptation())
    values = evaluate_run(estimate, recording, 1.0, [create("metric", {"name": name}) for name in names("metric")])

    assert run_status(estimate, recording, limit_m=1000.0) == ("ok", "")
    assert np.isnan([value for name, value in values.items() if name.startswith(("position", "velocity", "an"))]).all()


def test_an_angle_that_is_no_number_is_a_divergence():
    recording = recording_at_rest(10.0)
    attitude = level_attitude(recording)
    attitude.euler_rad[500] = np.nan
    status, why = run_status(
        AttitudeOnlyFilter().estimate(recording, attitude, NoAdaptation()), recording, limit_m=1000.0
    )

    assert status == "diverged"
    assert "not finite at 5.01 s" in why


NOT_JERK = "filter jerk cannot run over it, only: attitude_command, attitude_only"


@pytest.mark.parametrize(("name", "said"), [("jerk", NOT_JERK), ("", "")])
def test_a_data_set_without_position_takes_no_other_filter(name, said):
    parts = {"attitude": "tilt", "adaptation": "none", "engine": "filterpy", "filter": name or "attitude_only"}
    spec = {kind: {"name": one} for kind, one in parts.items()}
    spec["dataset"] = {"name": "broad", "folder": "nowhere"}
    cell = build({**spec, "disturbance": []}, Protocol())

    assert said in refusal(cell)
    assert bool(said) == bool(refusal(cell))
