"""Both ways of an estimator, as a cell takes them: the engine decides."""

import numpy as np
import pytest

from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.evaluation.evaluated_run import prepare_reference
from jerkbench.filters.imm import InteractingMultipleModels
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.rows import job_rows as rows_of_job
from jerkbench.sums import RecordedRun
from jerkbench.timeline import build_timeline

SPEC = {
    "dataset": {"name": "field", "duration_s": 10.0},
    "disturbance": [{"name": "none"}],
    "attitude": {"name": "tilt"},
    "filter": {"name": "imm"},
    "adaptation": {"name": "mtf"},
}


def rows_of(engine):
    rows, _ = rows_of_job(build({**SPEC, "engine": {"name": engine}}, Protocol(seeds=2)))
    return rows


def refuse(*_, **__):
    raise AssertionError


@pytest.mark.slow
def test_the_engine_decides_which_way_an_estimator_takes(monkeypatch):
    with monkeypatch.context() as without:
        for name in ("estimate_compiled", "run_settings"):
            without.setattr(InteractingMultipleModels, name, refuse)
        plain = rows_of("filterpy")
    monkeypatch.setattr(InteractingMultipleModels, "estimate", refuse)
    quick = rows_of("compiled")

    assert [row["status"] for row in plain + quick] == ["ok"] * 4
    for reference, row in zip(plain, quick, strict=True):
        for name, value in reference.items():
            if isinstance(value, float):
                assert row[name] == pytest.approx(value, rel=1e-7, abs=1e-9, nan_ok=True), name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rts", "imm", "eskf15", "iekf"])
def test_an_estimator_runs_side_by_side_where_errors_alone_are_asked(name):
    """Its loop got rows of R of one axis, which only that of a plain filter takes: each run was lost, and run alone."""
    model, recording = plugins.create("filter", {"name": name}), FieldWhite(duration_s=12.0).load(4)
    attitude = Tilt().estimate(recording)
    timeline = build_timeline(recording, attitude)
    scene = prepare_reference(recording, timeline, 5.0)
    whole, bare = (
        model.run_settings(
            [RecordedRun(recording, attitude, timeline, scoring)] * 3,
            [model] * 3,
            [Mtf()] * 3,
            updates=False,
            attitude=False,
            threads=1,
        )[0]
        for scoring in (scene.scoring, scene.errors_alone)
    )

    assert bare is not None
    for sums in ("position_m2", "velocity_m2ps2", "whole_m2", "largest_m2", "nis_per_row", "nis_used_per_row"):
        np.testing.assert_allclose(getattr(bare, sums), getattr(whole, sums), rtol=1e-12)
