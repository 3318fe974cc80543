"""Runs in one batch give the rows of single runs, whichever engine and estimator."""

import dataclasses
from typing import ClassVar

import pytest

from jerkbench.adaptation.mtf import Mtf
from jerkbench.errors import PluginError
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.filters.imm import InteractingMultipleModels
from jerkbench.filters.kinematic import Jerk
from jerkbench.filters.rts import RauchTungStriebel
from jerkbench.jobs import rows as run
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import job_of_parts
from jerkbench.jobs.rows import Task, job_rows, shared_inputs, task_rows
from jerkbench.parameters import Column, RScale
from made_jobs import job_with, with_method

FIELD = {"name": "field", "duration_s": 12.0}
DRAWS = (3, 4, 5)


def cell_of(model="jerk", adaptation="mtf", engine="compiled", disturbance="none", metrics=("position_rmse",)):
    single = {"dataset": FIELD, "attitude": None, "filter": model, "adaptation": adaptation, "engine": engine}
    return job_of_parts(single, [disturbance], None, Protocol(seeds=3, first_seed=3), list(metrics))


def alone(cell):
    return [(row["status"], row["position_rmse_m"]) for row in job_rows(cell, DRAWS)[0]]


def together(cells):
    shared_inputs.cache_clear()
    results = task_rows(Task(tuple(cells), DRAWS))
    return [[(row["status"], row["position_rmse_m"]) for row in rows] for rows, _ in results]


def settings_of(cell):
    changes = [
        {"filter": Jerk(accel_mps2=0.3)},
        {"adaptation": Mtf(window=5)},
        {"r_scale": RScale(position=3.0)},
        {"filter": Jerk(jerk_mps3_per_sqrt_s=0.5), "r_scale": RScale(0.5, 2.0)},
    ]
    return [cell, *(with_method(cell, **change) for change in changes)]


@pytest.mark.parametrize("disturbance", ["none", "noise_step"])
def test_each_setting_has_the_rows_that_it_has_alone(disturbance):
    cells = settings_of(cell_of(disturbance=disturbance))

    for many, one in zip(together(cells), map(alone, cells), strict=True):
        assert many == one


def test_a_metric_reads_the_same_whatever_else_is_asked_for():
    """Velocities, and covariances, are summed up where a metric reads them alone."""
    p, v, c, o = "position_rmse", "velocity_rmse", "consistency", "outage"
    alone_p, alone_v, both = (job_rows(cell_of(metrics=of), DRAWS)[0] for of in ([p], [v], [p, v]))
    outage = {"name": "gnss_outage", "windows_s": [[7, 9]]}
    bare, whole = (job_rows(cell_of(metrics=of, disturbance=outage), DRAWS)[0] for of in ([p, v, o], [p, v, o, c]))

    assert both == [one | other for one, other in zip(alone_p, alone_v, strict=True)]
    assert all(row["velocity_rmse_mps"] > 0.0 for row in both)
    for own, row in zip(bare, whole, strict=True):
        assert own["outage_end_m"] > 0.0
        numbers = {name: value for name, value in own.items() if isinstance(value, float)}
        assert {name: row[name] for name in numbers} == pytest.approx(numbers, rel=1e-12, nan_ok=True)


@dataclasses.dataclass(frozen=True)
class Pace:
    """A metric of a stranger, who does not know `Summed`: it says nothing of what it reads of the sums."""

    columns: ClassVar = {"pace_m2ps2": Column("Squares of the velocity error")}
    reads: ClassVar[str] = "updates"

    def summarise(self, sums):
        return {"pace_m2ps2": float(sums.velocity_m2ps2[0])}

    def evaluate(self, estimate, recording, counted):
        raise AssertionError("a run without a trajectory is enough")


def test_a_metric_that_does_not_say_what_it_reads_gets_all_of_it_and_a_lost_run_is_a_row():
    cell = cell_of()
    strange = dataclasses.replace(cell, metrics={"pace": Pace()})
    assert all(row["pace_m2ps2"] > 0.0 for row in job_rows(strange, DRAWS)[0])
    lost = dataclasses.replace(cell, protocol=dataclasses.replace(cell.protocol, divergence_limit_m=1e-3))
    assert {status for status, _ in together([lost])[0]} == {"diverged"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("rts", RauchTungStriebel("jerk", 0.3)),
        ("imm", InteractingMultipleModels(first_stays=0.8)),
        ("eskf15", Eskf15(accel_turn_on_mg=40.0)),
    ],
)
def test_settings_of_an_estimator_have_the_rows_that_they_have_alone(name, model):
    cell = cell_of(name)
    cells = [cell, *(with_method(cell, **change) for change in ({"filter": model}, {"r_scale": RScale(4.0)}))]

    rows = together(cells)

    assert len({value for row in rows for _, value in row}) == 3 * len(DRAWS)
    for many, one in zip(rows, map(alone, cells), strict=True):
        assert [status for status, _ in many] == ["ok"] * len(DRAWS)
        assert many == one


@pytest.mark.parametrize(("model", "engine"), [("gnss_only", "compiled"), ("baseline", "filterpy")])
def test_what_does_not_run_side_by_side_runs_one_after_the_other(model, engine):
    cell = cell_of(model, "none", engine)
    told = with_method(cell, r_scale=RScale(position=4.0))

    assert together([cell, told]) == [alone(cell), alone(told)]


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
        patch.setattr(run, "single_run", lambda *_, **__: pytest.fail("a run that came to its end was repeated"))
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


def rows_by(engine):
    rows, _ = job_rows(job_with(Protocol(seeds=2), filter="imm", adaptation="mtf", engine=engine))
    return rows


def refuse(*_, **__):
    raise AssertionError


@pytest.mark.slow
def test_the_engine_decides_which_way_an_estimator_takes(monkeypatch):
    with monkeypatch.context() as without:
        for name in ("estimate_compiled", "run_settings"):
            without.setattr(InteractingMultipleModels, name, refuse)
        plain = rows_by("filterpy")
    monkeypatch.setattr(InteractingMultipleModels, "estimate", refuse)
    quick = rows_by("compiled")

    assert [row["status"] for row in plain + quick] == ["ok"] * 4
    for reference, row in zip(plain, quick, strict=True):
        for name, value in reference.items():
            if isinstance(value, float):
                assert row[name] == pytest.approx(value, rel=1e-7, abs=1e-9, nan_ok=True), name
