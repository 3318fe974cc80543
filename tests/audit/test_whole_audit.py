"""An audit of seconds, from the protocol to its page."""

import dataclasses
import json
import shutil

import pandas as pd
import pytest

import jerkbench
from jerkbench.audit.page import verdict_frame
from jerkbench.audit.protocol import AuditProtocol, read_protocol
from jerkbench.audit.study import run_audit
from jerkbench.errors import JerkbenchError
from jerkbench.hydra_app.words import cluster_named
from jerkbench.jobs import run as loop
from jerkbench.jobs.cluster import Local
from jerkbench.jobs.key import code_digest

FAMILIES = ("none", "outliers", "wheel_slip")


@pytest.fixture(scope="module")
def protocol():
    small = read_protocol("small")
    families = tuple(
        dataclasses.replace(family, severities=dict(list(family.severities.items())[-1:]))
        for family in small.families
        if family.name in FAMILIES
    )
    return dataclasses.replace(
        small,
        duration_s=30.0,
        fields={"white": "field_white"},
        filters=("baseline",),
        adaptations=("chi2",),
        families=families,
        trials=3,
        restarts=1,
        finalists=2,
        tune_seeds=1,
        choose_seeds=1,
        test_seeds=3,
    )


@pytest.fixture(scope="module", autouse=True)
def files_apart():
    """Small files are not joined, so that one of them can be lost."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jerkbench.results.store.MANY_PARTS", 1000)
        yield


@pytest.fixture(scope="module")
def finished(protocol, tmp_path_factory):
    folder = tmp_path_factory.mktemp("audit") / "audit-tiny"
    return folder, run_audit(protocol, folder, Local(), workers=1)


def seeds_in(path):
    return {seed for _, seed in runs_in([path])}


def runs_in(paths):
    tables = [pd.read_parquet(path) for path in paths]
    return [run for table in tables for run in zip(table["cell.key"], table["seed"], strict=True)]


def spied(monkeypatch):
    """Record key and seed of each run."""
    original, ran = loop.work, []

    def work(task, **how):
        ran.extend((job.key, draw) for job in task.jobs for draw in task.draws)
        return original(task, **how)

    monkeypatch.setattr(loop, "work", work)
    return ran


def test_a_row_is_what_a_run_of_its_setting_gives(protocol, finished):
    """By the Python API, from the table of settings alone."""
    folder, audit = finished
    settings = pd.read_csv(folder / "settings.csv")
    own = settings[(settings.adaptation == "chi2") & (settings.tuned_on == "second")].set_index("knob")["value"]
    (scenario,) = [s for s in protocol.scenarios if s.family == "outliers"]
    parts = {part: {} for part in ("filter", "adaptation", "r_scale")}
    for knob, value in own.items():
        part, name = knob.split(".")
        parts[part][name] = int(value) if name == "longest" else value
    row = jerkbench.run(
        dataset=scenario.dataset,
        disturbance=scenario.disturbance,
        filter={"name": "baseline", **parts["filter"]},
        adaptation={"name": "chi2", **parts["adaptation"]},
        r_scale=parts["r_scale"],
        seeds=1,
        first_seed=protocol.seeds_to_test_on[0],
    ).iloc[0]
    test = audit.outcome.test
    trial = next(
        k
        for search, k in audit.outcome.trial.items()
        if search.tuned_on == "second" and search.method.adaptation == "chi2"
    )
    number = [s.family for s in protocol.scenarios].index("outliers")
    stored = test[(test.scenario == number) & (test.adaptation == "chi2") & (test.trial == trial)].iloc[0]
    assert stored.position_rmse_m == pytest.approx(row.position_rmse_m, rel=1e-9)


def test_a_setting_is_run_only_where_a_verdict_reads_it(protocol, finished):
    """What was tuned on one half is scored on the other half and where nothing is wrong; the defaults everywhere."""
    _, audit = finished
    known = list(protocol.scenarios)
    halves = {scenario.half: number for number, scenario in enumerate(known)}
    for search, trial in audit.outcome.trial.items():
        rows = audit.outcome.test
        same = {t for s, t in audit.outcome.trial.items() if s.method == search.method and s != search}
        if trial == 0 or trial in same:
            continue
        own = rows[(rows["filter"] == search.method.filter) & (rows["adaptation"] == search.method.adaptation)]
        other = {"first": "second", "second": "first"}.get(search.tuned_on)
        where = {halves["both"], halves[other]} if other else set(halves.values())
        assert set(own.loc[own["trial"] == trial, "scenario"]) == where
    assert set(audit.outcome.test.query("trial == 0")["scenario"]) == set(range(len(known)))


def test_an_audit_that_was_stopped_goes_on_and_comes_out_the_same(protocol, finished, monkeypatch):
    folder, audit = finished
    files = sorted((folder / "runs" / "cells").iterdir())
    assert len(files) >= 3  # one a stage at least
    lost = runs_in([files[0], files[1]])
    files[0].unlink()
    files[1].write_bytes(b"damaged")
    ran = spied(monkeypatch)
    again = run_audit(protocol, folder, Local(), workers=1)
    assert sorted(ran) == sorted(lost)
    timeless = [frame.drop(columns="seconds") for frame in (audit.outcome.test, again.outcome.test)]
    pd.testing.assert_frame_equal(*timeless)
    assert again.outcome.chosen == audit.outcome.chosen


def test_what_other_code_computed_is_judged_when_asked_for_and_nothing_is_run(
    protocol, finished, monkeypatch, tmp_path
):
    folder = shutil.copytree(finished[0], tmp_path / "audit-tiny")
    code = code_digest()
    monkeypatch.setattr("jerkbench.jobs.key.code_digest", lambda *_: "another")
    monkeypatch.setattr(loop, "work", lambda *_, **__: pytest.fail("a run"))
    with_one_more = dataclasses.replace(protocol, adaptations=("chi2", "mtf"))
    monkeypatch.setattr(AuditProtocol, "digest", protocol.digest)  # of "every adaptation", to which one has come

    again = run_audit(with_one_more, folder, Local(), workers=1, only_stored=True)

    both = [verdict_frame(audit.verdicts).drop(columns="step_ns") for audit in (finished[1], again)]
    pd.testing.assert_frame_equal(*both)
    made_by = json.loads((folder / "manifest.json").read_text())["rows_computed_by"]
    assert [maker.split()[0] for maker in made_by] == [code]
    choosing = set(protocol.seeds_to_choose_on)
    next(path for path in folder.rglob("part-*.parquet") if seeds_in(path) == choosing).unlink()
    with pytest.raises(JerkbenchError, match=r"\d+ are missing or of other settings.*without --stored"):
        run_audit(protocol, folder, Local(), workers=1, only_stored=True)


def test_the_runs_that_score_are_not_read_before_every_setting_is_chosen(protocol, tmp_path, monkeypatch):
    test, original = set(protocol.seeds_to_test_on), loop.work

    def poisoned(task, **how):
        if test & set(task.draws):
            raise RuntimeError("test")
        return original(task, **how)

    monkeypatch.setattr(loop, "work", poisoned)
    with pytest.raises(RuntimeError, match="test"):
        run_audit(protocol, tmp_path / "audit-tiny", Local(), workers=1)
    seeds = {seed for path in tmp_path.rglob("part-*.parquet") for seed in seeds_in(path)}
    assert seeds == {*protocol.seeds_to_tune_on, *protocol.seeds_to_choose_on}


def test_the_folder_says_what_was_done(protocol, finished):
    folder, audit = finished
    assert json.loads((folder / "manifest.json").read_text())["protocol"] == protocol.digest
    assert f"digest `{protocol.digest}`" in (folder / "README.md").read_text()
    assert pd.read_csv(folder / "verdicts.csv").adaptation.tolist() == ["chi2"]
    assert len(pd.read_parquet(folder / "rows.parquet")) == len(audit.outcome.test)
    assert (folder / "ratios.png").stat().st_size > 5000


@pytest.mark.slow
@pytest.mark.parametrize("cluster", ["local", "dask"])
def test_on_a_cluster_everything_comes_out_as_here(protocol, finished, tmp_path, cluster):
    if cluster == "dask":
        pytest.importorskip("distributed")
    folder, _ = finished
    run_audit(protocol, tmp_path / "audit-tiny", cluster_named(cluster), workers=2)

    here, there = (place / "settings.csv" for place in (folder, tmp_path / "audit-tiny"))
    assert there.read_bytes() == here.read_bytes()
    here, there = (pd.read_csv(place / "verdicts.csv") for place in (folder, tmp_path / "audit-tiny"))
    pd.testing.assert_frame_equal(there.drop(columns="step_ns"), here.drop(columns="step_ns"), rtol=0.0, atol=0.0)
