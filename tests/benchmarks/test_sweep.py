"""The benchmark of a sweep's stages prints a line for each stage."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import pytest
import sweep

STAGES = ("read from the disk", "disturbed", "attitude", "timeline", "filtered and scored", "stored", "looked up")


@pytest.mark.slow
def test_every_stage_has_its_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["sweep.py", "--seeds", "1"])
    sweep.main()
    printed = capsys.readouterr().out
    assert all(stage in printed for stage in STAGES)
