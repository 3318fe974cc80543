"""Rows of a cell: the same whether its seeds go side by side or alone."""

import pytest

from jerkbench.errors import PluginError
from jerkbench.jobs import rows as run
from jerkbench.jobs.job import Protocol
from made_jobs import job_with

PARTS = {
    "dataset": {"name": "field", "duration_s": 20.0},
    "disturbance": "imu_bias",
    "filter": "baseline",
    "adaptation": "scalar_r",
}


def rows_of(limit_m, **changed):
    job = job_with(Protocol(seeds=3, divergence_limit_m=limit_m), **{**PARTS, **changed})
    rows, notes = run.job_rows(job)
    assert notes == ["Reference of field: simulated truth; independent of the measurements."]
    return rows


@pytest.mark.parametrize(
    ("filter_", "limit_m"), [("baseline", 1000.0), ("baseline", 0.05), ("imm", 0.05), ("rts", 0.03), ("eskf15", 0.05)]
)
def test_a_run_that_goes_too_far_has_the_row_that_it_has_alone(monkeypatch, filter_, limit_m):
    """The sentence too; `rts` meets its errors from the last one on."""
    together = rows_of(limit_m, filter=filter_)
    with monkeypatch.context() as patch:
        patch.setattr(run, "alone", lambda *_, **__: pytest.fail("a run that came to its end was repeated"))
        assert len(rows_of(limit_m, filter=filter_)) == len(together)
    monkeypatch.setattr(run, "streams", lambda _: False)
    alone = rows_of(limit_m, filter=filter_)

    for one, other in zip(together, alone, strict=True):
        assert one["status"] == ("ok" if limit_m == 1000.0 else "diverged")
        assert (one["reason"] != "") == (limit_m < 1000.0)
        assert one.keys() == other.keys()
        for name, value in one.items():
            assert value == (
                pytest.approx(other[name], rel=1e-9, nan_ok=True) if isinstance(value, float) else other[name]
            )


def test_what_the_engine_raises_is_a_failed_row_and_no_slower_run(monkeypatch):
    from jerkbench.engines.compiled_engine import CompiledEngine

    def broken(*_, **__):
        raise ArithmeticError("the engine is broken")

    alone = []
    monkeypatch.setattr(CompiledEngine, "run_settings", broken)
    monkeypatch.setattr(CompiledEngine, "run", lambda *given: alone.append(given))
    cell = job_with(Protocol(seeds=3), **PARTS)
    rows, _ = run.job_rows(cell)

    assert [row["status"] for row in rows] == ["failed"] * 3
    assert all("the engine is broken" in row["reason"] for row in rows)
    with pytest.raises(PluginError, match="the engine is broken"):
        run.job_rows(cell, strict=True)
    assert alone == []
