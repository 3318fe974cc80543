"""Both ways of an estimator, as a cell takes them: the engine decides."""

import pytest

from jerkbench.filters.imm import InteractingMultipleModels
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.rows import job_rows
from made_jobs import job_with


def rows_of(engine):
    rows, _ = job_rows(job_with(Protocol(seeds=2), filter="imm", adaptation="mtf", engine=engine))
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
