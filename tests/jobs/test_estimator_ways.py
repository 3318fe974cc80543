"""Both ways of an estimator, as a cell takes them: the engine decides."""

import pytest

from jerkbench.filters.imm import InteractingMultipleModels
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.rows import job_rows as rows_of_job

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
