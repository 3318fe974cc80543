"""A program as an attitude filter: what it is told, what it may write, and the same numbers as our own Madgwick."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.madgwick import Madgwick
from jerkbench.datasets.field import Field
from jerkbench.errors import RecordingError
from jerkbench.evaluation.counted_rows import angle_between
from jerkbench.filters.attitude_only import AttitudeCommand
from jerkbench.geometry import vertical_in_body

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


def test_the_examples_are_our_own_filter(recording, tmp_path):
    """But for the first step: they do not know its length."""
    ours, _ = Madgwick().verticals(recording)
    for command in commands(tmp_path):
        estimate = estimated(recording, command)
        theirs = vertical_in_body(estimate.euler_rad)
        assert estimate.attitude_only
        assert np.degrees(angle_between(theirs, ours[: len(theirs)]).max()) < 0.05, command
        assert np.degrees(angle_between(theirs[500:], ours[500 : len(theirs)]).max()) < 1e-3, command


def test_it_is_told_the_imu_alone(recording, tmp_path):
    estimated(recording, script(tmp_path, WRITE_LEVEL + f"open({str(tmp_path / 'head')!r}, 'w').write(lines[0])"))

    stream = [f"{kind}_{axis}_{unit}" for kind, unit in (("accel", "mps2"), ("gyro", "radps")) for axis in AXES]
    assert (tmp_path / "head").read_text().split(",") == ["t_s", "evaluated", *stream]


OPEN = """
import sys
lines = open(sys.argv[1]).read().splitlines()
out = open(sys.argv[2], "w")
"""
AXES = ("forward", "left", "up")
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
    ("text", "sentence"),
    [
        (WRITE_LEVEL.replace("lines[1:]", "lines[2:]"), "write one for each of the 1500 rows"),
        (WRITE_LEVEL.replace("2,0,0,0", "0,0,0,0"), "row 1: the attitude .* is no quaternion"),
        (WRITE_LEVEL.replace("2,0,0,0", "1,nan,0,0"), "is no quaternion"),
        (WRITE_LEVEL.replace("qw,", "w,"), "qw"),
        ("out.close()", "is empty|no column|has no"),
        ("sys.exit(3)", "ended with exit code 3"),
    ],
)
def test_what_cannot_be_scored_is_a_sentence(recording, tmp_path, text, sentence):
    with pytest.raises(RecordingError, match=sentence):
        estimated(recording, script(tmp_path, text))
