"""Seeds in blocks: interrupted jobs, and seeds=auto."""

import json

import pandas as pd
import pytest

from commands import swept
from jerkbench.errors import PluginError
from jerkbench.hydra_app.overrides import seed_options
from jerkbench.jobs import run as loop
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import MAX_CACHED_INPUTS, Task, job_rows
from jerkbench.jobs.run import blocks_of, origin, run_missing, work
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import load_study
from jerkbench.report.comparisons import VerdictRule
from made_jobs import job_with
from stored_cells import keys_of, write_blocks

SEEDS = 2 * MAX_CACHED_INPUTS + 3


def plan_of(seeds=SEEDS, **changed):
    return planned([job_with(Protocol(seeds=seeds, first_seed=4), **changed)])


@pytest.fixture
def store(tmp_path):
    opened = Store(tmp_path)
    opened.prepare()
    return opened


def spied(monkeypatch, stop_after=None):
    """Record the seeds of each piece that is run; the piece after the last that is wanted is interrupted."""
    original, seen = loop.work, []

    def work(task, made_by, **how):
        if stop_after is not None and len(seen) == stop_after:
            raise KeyboardInterrupt
        results = original(task, made_by, **how)
        seen.append([row["seed"] for row in results[0].rows])
        return results

    monkeypatch.setattr(loop, "work", work)
    return seen


def require_undisturbed(store, job):
    (stored,), broken = store.read([job.key])
    rows, notes = job_rows(job)
    pd.testing.assert_frame_equal(stored.rows, pd.DataFrame(rows), check_exact=True)
    assert stored.metadata["notes"] == notes
    assert broken == []


@pytest.mark.parametrize(
    ("strict", "plan", "finished", "left"),
    [
        (False, plan_of(), 2, [*range(4 + 2 * MAX_CACHED_INPUTS, 4 + SEEDS)]),
        (True, plan_of(MAX_CACHED_INPUTS + 2), 1, [4 + MAX_CACHED_INPUTS, 5 + MAX_CACHED_INPUTS]),
        (False, plan_of(4, filter="gnss_only"), 3, [7]),  # its runs go alone
    ],
)
def test_an_interrupted_job_continues_with_the_seeds_that_are_missing(store, monkeypatch, strict, plan, finished, left):
    with monkeypatch.context() as patched:
        spied(patched, stop_after=finished)
        with pytest.raises(KeyboardInterrupt):
            run_missing(plan, store, strict=strict)
    ran = spied(monkeypatch)
    run_missing(plan, store, strict=strict)

    assert ran == [left]
    require_undisturbed(store, plan.jobs[0])


def test_a_damaged_block_and_a_failed_run_are_run_again(store):
    (job,) = plan_of(seeds=2 * MAX_CACHED_INPUTS).jobs
    first, second = (list(job.draws)[k : k + MAX_CACHED_INPUTS] for k in (0, MAX_CACHED_INPUTS))
    paths = []
    for draws in (first, second):
        blocks = work(Task((job,), draws), origin())
        write_blocks(store, blocks)
        paths += [path for path in store.folder.iterdir() if path not in paths]
    paths[1].write_bytes(paths[1].read_bytes()[:-40])

    assert sorted(store.known([job.key])[job.key]) == first
    failed = [{**row, "status": "failed"} for row in blocks[0].rows[:3]]
    write_blocks(store, blocks_of(Task((job,), second[:3]), [(failed, [])], origin()))
    assert sorted(store.known([job.key])[job.key]) == first


SHORT = ("dataset.duration_s=40", "figures=false", "workers=1")


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("seeds=auto", ["seeds=20", "max_seeds=400"]),
        ("seeds=auto(max=60)", ["seeds=20", "max_seeds=60"]),
        ("'seeds=auto(max = 60)'", ["seeds=20", "max_seeds=60"]),
        ("seeds=7", ["seeds=7"]),
    ],
)
def test_auto_stands_for_the_first_look_and_the_most(word, words):
    assert seed_options(word) == words


def test_less_than_the_first_look_is_refused():
    with pytest.raises(PluginError, match="first interim analysis"):
        seed_options("seeds=auto(max=5)")


@pytest.mark.slow
def test_all_cells_end_with_the_same_look(tmp_path):
    """Whatever is decided, cells of all filters end with the same seeds, and the level of the last look is known."""
    swept("filter=gnss_only,jerk,baseline", "seeds=4", "max_seeds=8", *SHORT, cwd=tmp_path)
    study = load_study(tmp_path / "results" / "adhoc")
    assert set(study.rows.groupby("filter").size()) <= {4, 8}
    assert 0 < study.rows.attrs["level"] <= 0.05


@pytest.mark.slow
def test_seeds_are_added_until_the_most_and_runs_are_kept(tmp_path):
    """Two filters that are the same are never better or worse; with a margin they cannot meet they stay undecided."""
    words = ("filter=jerk,bias", "adaptation=mtf", "seeds=2", "max_seeds=5", *SHORT)
    swept(*words, cwd=tmp_path)
    folder = tmp_path / "results" / "adhoc"
    first = load_study(folder)
    assert sorted(first.rows["seed"].unique()) == [0, 1, 2, 3, 4]
    assert len(keys_of(folder)) == 2  # those of the last look alone
    levels = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["levels"]
    assert 0 < min(levels.values()) < 0.05
    assert VerdictRule().of(first.rows).level == min(levels.values())
    done = swept(*words, cwd=tmp_path)
    assert "2 of 2 combinations are already complete" in done.stderr
    pd.testing.assert_frame_equal(load_study(folder).rows, first.rows)
