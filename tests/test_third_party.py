"""Anybody's package of two files brings an adaptation into sweeps, lists and pages."""

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from commands import SHORT, jerkbench, swept
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.errors import PluginError
from jerkbench.jobs.job import TRACEBACK, Protocol, build
from jerkbench.jobs.rows import job_rows
from made_jobs import with_method

EXAMPLE = str(Path(__file__).parents[1] / "examples" / "plugin")


MODULE = '''
"""A rule of our own."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Doubt:
    """Multiplies R by a constant.

    Attributes:
        factor: the constant [-].
    """

    factor: float = 4.0

    def adapt(self, innovation, HPHt, R, rows, memory):
        return self.factor * R


@dataclass(frozen=True)
class Clumsy(Doubt):
    """Fails when it meets a velocity.

    Attributes:
        factor: the constant [-].
    """

    def adapt(self, innovation, HPHt, R, rows, memory):
        raise ZeroDivisionError("that was clumsy")


@dataclass(frozen=True)
class Idle:
    """Does nothing."""
'''
PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "doubting-filters"
version = "1.2"

[project.entry-points."jerkbench.adaptation"]
doubt = "doubting:Doubt"
clumsy = "doubting:Clumsy"
idle = "doubting:Idle"
lost = "doubting:Lost"

[project.entry-points."jerkbench.metric"]
gone = "doubting:Gone"

[tool.hatch.build.targets.wheel]
include = ["doubting.py"]
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder into which this package and the example of the repository are installed."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("installed")
    (source / "doubting.py").write_text(MODULE)
    (source / "pyproject.toml").write_text(PROJECT)
    words = ["install", "--quiet", "--no-deps", "--no-build-isolation", "--target", str(target), str(source), EXAMPLE]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, capture_output=True, timeout=120)
    return str(target)


@pytest.mark.slow
def test_the_example_keeps_its_contract_and_is_swept_beside_ours(installed, tmp_path):
    done = jerkbench("check", "jerkbench-geman-mcclure", cwd=tmp_path, PYTHONPATH=installed)
    swept("adaptation=none,geman_mcclure", "disturbance=outliers", cwd=tmp_path, PYTHONPATH=installed)
    rows = pd.read_csv(tmp_path / "results" / "adhoc" / "rows.csv").set_index("adaptation")

    assert (done.returncode, done.stdout) == (0, "adaptation geman_mcclure: satisfies its contract.\n")
    assert set(rows["status"]) == {"ok"}
    assert rows.loc["geman_mcclure", "position_rmse_m"] < rows.loc["none", "position_rmse_m"]


def test_it_is_listed_with_its_package_and_shown(installed, tmp_path):
    listed = jerkbench("list", "adaptation", cwd=tmp_path, PYTHONPATH=installed)

    assert "Multiplies R by a constant. [doubting]" in listed.stdout
    assert "factor = 4.0" in jerkbench("show", "adaptation", "doubt", cwd=tmp_path, PYTHONPATH=installed).stdout
    assert listed.stderr.count("\n") == 1
    assert "adaptation 'lost' of doubting-filters 1.2 cannot be loaded and is left out: AttributeError" in listed.stderr
    assert jerkbench("list", "filter", cwd=tmp_path, PYTHONPATH=installed).stderr == ""
    for metrics, count in (("[position_rmse]", 0), ("[all]", 1)):
        dry = jerkbench("run", "--dry", *SHORT, f"metrics={metrics}", cwd=tmp_path, PYTHONPATH=installed)
        assert dry.stderr.count("metric 'gone' of doubting-filters 1.2 cannot be loaded and is left out") == count


@pytest.mark.slow
def test_one_that_cannot_be_loaded_is_silent_until_it_is_asked_for(installed, tmp_path):
    quiet = swept("adaptation=none,doubt,mtf", "workers=2", cwd=tmp_path, PYTHONPATH=installed)
    asked = jerkbench("run", *SHORT, "adaptation=lost", cwd=tmp_path, PYTHONPATH=installed)

    assert "lost" not in quiet.stderr
    assert asked.returncode == 2
    assert asked.stderr.startswith(
        "jerkbench: adaptation 'lost' of doubting-filters 1.2 cannot be loaded and is left out: AttributeError"
    )


@pytest.mark.slow
def test_it_is_swept_with_its_parameters_and_agrees_with_a_filter_that_reports_that_r(installed, tmp_path):
    swept("adaptation=none,doubt", cwd=tmp_path, PYTHONPATH=installed)
    swept("adaptation=doubt", "adaptation.factor=1.0,2.0", cwd=tmp_path, PYTHONPATH=installed)
    rows = pd.read_csv(tmp_path / "results" / "adhoc" / "rows.csv").set_index("adaptation")["position_rmse_m"]

    assert set(rows.index) == {"none", "doubt", "doubt(factor=1.0)", "doubt(factor=2.0)"}
    assert rows["doubt(factor=1.0)"] == rows["none"]
    assert len(set(rows)) == 3


@pytest.mark.slow
def test_one_that_raises_is_a_row_with_the_reason_and_the_exit_code_says_so(installed, tmp_path):
    words = ["run", "-m", *SHORT, "adaptation=clumsy,none"]
    done = jerkbench(*words, cwd=tmp_path, PYTHONPATH=installed)
    rows = pd.read_csv(tmp_path / "results" / "adhoc" / "rows.csv").set_index("adaptation")

    assert done.returncode == 1
    assert rows.loc["clumsy", "status"] == "failed"
    assert rows.loc["clumsy", "reason"] == "ZeroDivisionError: that was clumsy (adapt, line 30)"
    assert rows.loc["none", "status"] == "ok"
    assert "failed 1/1" in done.stdout


SENTENCES = {
    "clumsy": "The adaptation clumsy failed: ZeroDivisionError: that was clumsy (adapt, line 30).",
    "idle": "Idle has no method adapt(); an adaptation needs it",
}


@pytest.mark.parametrize("name", SENTENCES)
def test_one_that_is_broken_ends_a_single_run_with_a_sentence(installed, tmp_path, name):
    done = jerkbench("run", *SHORT, f"adaptation={name}", cwd=tmp_path, PYTHONPATH=installed)

    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f"jerkbench: {SENTENCES[name]}")
    assert ("Set JERKBENCH_TRACEBACK=1 to see the traceback" in done.stderr) == (name == "clumsy")
    assert not list(tmp_path.rglob("*.parquet"))


def test_its_author_can_see_the_traceback(monkeypatch):
    class Clumsy(NoAdaptation):
        def adapt(self, innovation, HPHt, R, rows, memory):
            raise ZeroDivisionError("that was clumsy")

    spec = {kind: {"name": name} for kind, name in (("filter", "baseline"), ("engine", "compiled"))}
    spec |= {"dataset": {"name": "field", "duration_s": 12.0}, "attitude": {"name": "tilt"}, "disturbance": []}
    cell = with_method(build({**spec, "adaptation": {"name": "none"}}, Protocol(seeds=1)), adaptation=Clumsy())
    with pytest.raises(PluginError, match="that was clumsy"):
        job_rows(cell, strict=True)
    monkeypatch.setenv(TRACEBACK, "1")
    with pytest.raises(ZeroDivisionError, match="that was clumsy"):
        job_rows(cell, strict=True)
