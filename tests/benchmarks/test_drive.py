"""The navigation on the real drive beside others that may not be there."""

import sys

import numpy as np
import pytest

from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite


@pytest.fixture
def drive(script):
    return script("drive")


@pytest.fixture(scope="module")
def given():
    recording = FieldWhite(duration_s=8.0).load(0)
    return recording, Tilt().estimate(recording)


def test_what_is_not_there_is_named(drive, given, monkeypatch):
    assert "--kf-gins names no copy of its source" in drive.kf_gins(*given, None)
    monkeypatch.setitem(sys.modules, "pyins", None)
    assert "pip install python-ins" in drive.python_ins(*given, 1.0)


def test_the_error_is_that_at_the_stamps_of_the_reference_after_a_minute(drive, monkeypatch, given):
    recording, _ = given
    monkeypatch.setattr(drive, "SETTLED_S", 4.0)
    reference = recording.reference
    shifted = reference.enu_m + np.where(reference.t_s[:, None] < 4.0, 9.0, [3.0, 0.0, 4.0])
    assert drive.rmse_m(recording, reference.t_s, shifted) == pytest.approx(5.0)


@pytest.mark.slow
def test_every_stage_of_a_sweep_has_its_line(script, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["sweep.py", "--seeds", "1"])
    script("sweep").main()
    printed = capsys.readouterr().out
    stages = "read from the disk", "disturbed", "attitude", "timeline", "filtered and scored", "stored", "looked up"
    assert all(stage in printed for stage in stages)
