"""Filters that estimate an attitude alone, and programs that do."""

import dataclasses
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.mahony import Madgwick
from jerkbench.datasets.field import Field
from jerkbench.errors import RecordingError
from jerkbench.evaluation.counted_rows import angle_between
from jerkbench.evaluation.evaluated_run import evaluate_run, run_status
from jerkbench.filters.attitude_only import AttitudeCommand, AttitudeOnlyFilter
from jerkbench.geometry import vertical_in_body
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.names import refusal
from jerkbench.plugins import create, names
from synthetic import level_attitude, recording_at_rest


def test_the_angles_are_the_last_ones_at_or_before_each_stamp():
    recording = recording_at_rest(10.0)
    stamps = np.array([0.001, 1.0, 2.005, 3.0, 11.0])
    reference = dataclasses.replace(
        recording.reference, t_s=stamps, enu_m=None, velocity_mps=None, euler_rad=np.zeros((5, 3)), scored=None
    )
    recording = dataclasses.replace(recording, reference=reference)
    euler = np.zeros((len(recording.imu.t_s), 3))
    euler[:, 0] = recording.imu.t_s
    turning = dataclasses.replace(level_attitude(recording), euler_rad=euler)
    estimate = AttitudeOnlyFilter().estimate(recording, turning, NoAdaptation())

    assert estimate.index.tolist() == [1, 2, 3]  # no estimate before the first and after the last sample
    np.testing.assert_allclose(estimate.euler_rad[:, 0], [1.0, 2.0, 3.0])
    assert np.isnan(estimate.position_m).all()


def test_a_run_without_a_position_is_ok_unless_an_angle_is_nan():
    recording = recording_at_rest(10.0)
    estimate = AttitudeOnlyFilter().estimate(recording, level_attitude(recording), NoAdaptation())
    values = evaluate_run(estimate, recording, 1.0, [create("metric", {"name": name}) for name in names("metric")])
    assert run_status(estimate, recording, limit_m=1000.0) == ("ok", "")
    assert np.isnan([value for name, value in values.items() if name.startswith(("position", "velocity", "an"))]).all()
    attitude = level_attitude(recording)
    attitude.euler_rad[500] = np.nan
    status, why = run_status(
        AttitudeOnlyFilter().estimate(recording, attitude, NoAdaptation()), recording, limit_m=1000.0
    )
    assert status == "diverged"
    assert "not finite at 5.01 s" in why


NOT_JERK = "filter jerk cannot be used; possible filters: attitude_command, attitude_only"


@pytest.mark.parametrize(("name", "said"), [("jerk", NOT_JERK), ("", "")])
def test_a_data_set_without_position_supports_no_other_filter(name, said):
    parts = {"attitude": "tilt", "adaptation": "none", "engine": "filterpy", "filter": name or "attitude_only"}
    spec = {kind: {"name": one} for kind, one in parts.items()}
    spec["dataset"] = {"name": "broad", "folder": "nowhere"}
    cell = build({**spec, "disturbance": []}, Protocol())

    assert said in refusal(cell)
    assert bool(said) == bool(refusal(cell))


EXAMPLES = Path(__file__).parents[2] / "examples" / "any_language"


@pytest.fixture(scope="module")
def recording():
    return Field(duration_s=15.0).load(0)


def estimated(recording, command):
    model = AttitudeCommand(command=f"{command} {{recording}} {{out}}")
    return model.estimate(recording, Madgwick().estimate(recording), NoAdaptation())


def script(folder, text):
    path = folder / "program.py"
    path.write_text(f"{OPEN}\n{text}\n")
    return f"{sys.executable} {path}"


def commands(folder):
    yield f"{sys.executable} {EXAMPLES / 'madgwick.py'}"
    if shutil.which("cc"):
        subprocess.run(["cc", "-O2", "-o", folder / "madgwick", EXAMPLES / "madgwick.c", "-lm"], check=True)
        yield str(folder / "madgwick")


def test_the_examples_agree_with_madgwick(recording, tmp_path):
    """The first step differs, because the examples do not know its length."""
    ours, _ = Madgwick().verticals(recording)
    for command in commands(tmp_path):
        estimate = estimated(recording, command)
        theirs = vertical_in_body(estimate.euler_rad)
        assert estimate.attitude_only
        assert np.degrees(angle_between(theirs, ours[: len(theirs)]).max()) < 0.05, command
        assert np.degrees(angle_between(theirs[500:], ours[500 : len(theirs)]).max()) < 1e-3, command


def test_the_program_receives_only_the_imu(recording, tmp_path):
    estimated(recording, script(tmp_path, WRITE_LEVEL + f"open({str(tmp_path / 'head')!r}, 'w').write(lines[0])"))

    stream = [
        f"{kind}_{axis}_{unit}"
        for kind, unit in (("accel", "mps2"), ("gyro", "radps"))
        for axis in ("forward", "left", "up")
    ]
    assert (tmp_path / "head").read_text().split(",") == ["t_s", "evaluated", *stream]


OPEN = """
import sys
lines = open(sys.argv[1]).read().splitlines()
out = open(sys.argv[2], "w")
"""
WRITE_LEVEL = """
print("t_s,qw,qx,qy,qz", file=out)
for line in lines[1:]:
    print(line.split(",")[0], "2,0,0,0", sep=",", file=out)
out.close()
"""


def test_a_quaternion_need_not_have_length_one_and_the_heading_is_free(recording, tmp_path):
    estimate = estimated(recording, script(tmp_path, WRITE_LEVEL))

    np.testing.assert_allclose(estimate.euler_rad, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (WRITE_LEVEL.replace("lines[1:]", "lines[2:]"), "write one row for each of the 1500 rows"),
        (WRITE_LEVEL.replace("2,0,0,0", "0,0,0,0"), "row 1: the attitude .* is not a valid quaternion"),
        (WRITE_LEVEL.replace("2,0,0,0", "1,nan,0,0"), "is not a valid quaternion"),
        (WRITE_LEVEL.replace("qw,", "w,"), "qw"),
        ("out.close()", "is empty|no column|has no"),
        ("sys.exit(3)", "ended with exit code 3"),
    ],
)
def test_output_that_cannot_be_scored_raises(recording, tmp_path, text, message):
    with pytest.raises(RecordingError, match=message):
        estimated(recording, script(tmp_path, text))
