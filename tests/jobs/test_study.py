"""A study's folder: which of several results of the same name is shown, and what is said about the others."""

import re

import pytest

from jerkbench.errors import JerkbenchError, PluginError, RecordingError
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.key import write_manifest
from jerkbench.jobs.plan import planned
from jerkbench.jobs.store import RowBlock, Store
from jerkbench.jobs.study import load_study, write_study
from jerkbench.report.changes import other_methods, require_alike
from jerkbench.report.findings import findings, study_verdicts
from jerkbench.report.summary import summarise
from made_jobs import SPEC
from stored_cells import LABELS, about, put, row, store_cell, write_blocks

KEYS_OF_TWO = ("a" * 20, "b" * 20)


def sentences(rows, metric):
    return findings(rows, study_verdicts(rows, metric))


def shown(study):
    return dict(zip(study.keys, study.rows["position_rmse_m"], strict=True))


def test_of_two_results_of_one_name_the_planned_one_is_shown_even_if_it_is_older(tmp_path):
    put(tmp_path, "01d", 0.1, created="2026-01-01T00:00:00Z")
    put(tmp_path, "4e", 0.2, created="2026-02-01T00:00:00Z", code="b")

    assert shown(load_study(tmp_path)) == {"4e": 0.2}
    assert shown(load_study(tmp_path, {"01d": [0]})) == {"01d": 0.1}
    write_manifest(tmp_path, {"01d": [0]}, [], ["jerkbench"])
    assert shown(load_study(tmp_path)) == {"01d": 0.1}
    write_study(load_study(tmp_path))  # it raised where two rows had one name


def drive(folder):
    return {"spec": {"dataset": {"name": "drive", "folder": f"/data/{folder}"}}, "data": f"hash of {folder}"}


UNLIKE = {
    "data": (drive("A"), drive("B"), "dataset.folder (A, B)"),
    "changed data": ({**drive("A"), "data": "1"}, {**drive("A"), "data": "2"}, "data (1, 2)"),
    "protocol": ({"protocol": {"burn_in_s": 0.0}}, {"protocol": {"burn_in_s": 10.0}}, "burn_in_s (0.0, 10.0)"),
    "engine": (
        {"spec": {"engine": {"name": "filterpy"}}},
        {"spec": {"engine": {"name": "compiled"}}},
        "engine.name (filterpy, compiled)",
    ),
    "disturbance": (
        {"spec": {"disturbance": [{"name": "bias", "file": "/a/x"}]}},
        {"spec": {"disturbance": [{"name": "bias", "file": "/b/x"}]}},
        "bias.file (/a/x, /b/x)",
    ),
}


@pytest.mark.parametrize(("first", "second", "words"), UNLIKE.values(), ids=UNLIKE)
def test_what_was_not_measured_alike_is_never_compared_and_that_is_said(tmp_path, first, second, words):
    put(tmp_path, "1", 3.36, filter="baseline", seeds=8, conditions=first)
    put(tmp_path, "2", 23.8, filter="jerk", seeds=8, conditions=second)
    study = load_study(tmp_path)
    table = summarise(study.rows, "position_rmse_m", None, ["filter"], study.notes, {"filter": "baseline"})

    assert not any(cell.ratio or cell.best for row in table.cells for cell in row if cell)
    assert len(table.rows) == 2
    assert sentences(study.rows, "position_rmse_m") == []
    assert any(words in note and "not compared" in note for note in table.footnotes)


def test_parameters_that_a_label_does_not_say_are_said_and_the_same_data_are_the_same_anywhere(tmp_path):
    for key, adaptation, sigma in (("1", "none", 0.1), ("2", "mtf", 1.0)):
        spec = {"filter": {"name": "jerk", "accel_mps2": sigma}}
        put(tmp_path, key, sigma, adaptation=adaptation, seeds=8, conditions={"spec": spec})
    study = load_study(tmp_path)
    assert set(study.rows["filter"]) == {"jerk(accel_mps2=0.1)", "jerk(accel_mps2=1.0)"}
    (sentence,) = sentences(study.rows, "position_rmse_m")
    assert sentence.startswith("jerk(accel_mps2=1.0)+mtf is 10.0 times worse than jerk(accel_mps2=0.1)+none")
    put(tmp_path / "b", "1", 3.0, filter="baseline", seeds=8, conditions=drive("A"))
    put(tmp_path / "b", "2", 4.0, filter="jerk", seeds=8, conditions={**drive("B"), "data": "hash of A"})
    study = load_study(tmp_path / "b")
    assert set(study.rows["dataset"]) == {"field"}
    assert len(sentences(study.rows, "position_rmse_m")) == 1


def test_notes_belong_to_their_cells_and_say_what_is_not_shown(tmp_path):
    put(tmp_path, "01d", 0.1)
    put(tmp_path, "4e", 0.2, created="2026-02-01T00:00:00Z")
    put(tmp_path, "07", 0.3, code="b", filter="bias")
    (tmp_path / "cells" / "b0.parquet").write_bytes(b"PAR1")
    notes = load_study(tmp_path).notes
    assert "1 result of the same name with other settings, code or data is left out." in notes
    assert "These results come from 2 versions of the code or its libraries." in notes
    assert "1 damaged file of results is left out: b0." in notes
    put(tmp_path / "b", "1", 0.1)
    write_manifest(tmp_path / "b", {"1": [0]}, ["a first note"], ["jerkbench"])
    write_manifest(tmp_path / "b", {"1": [0]}, ["a corrected note"], ["jerkbench"])
    put(tmp_path / "b", "2", 0.2, filter="bias")
    write_manifest(tmp_path / "b", {"2": [0]}, ["a note on bias"], ["jerkbench"])
    assert list(load_study(tmp_path / "b").keys) == ["1", "2"]
    told = "Not as published: simplified: bias. `jerkbench show` describes the differences."
    notes = load_study(tmp_path / "b").notes
    assert notes == ("a corrected note", "a note on bias", "recording of 1", "recording of 2", told)
    assert load_study(tmp_path / "b").only(["1"]).notes == ("a corrected note", "recording of 1", told)


def test_what_cannot_be_written_or_told_apart_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "cells").write_text("a file where the folder should be")
    with pytest.raises(JerkbenchError, match="Results cannot be written to"):
        Store(tmp_path).prepare()
    cells = [build({**SPEC, "engine": {"name": name}}, Protocol()) for name in ("filterpy", "compiled")]
    with pytest.raises(PluginError, match="differ in engine"):
        planned(cells)


def shards(*first_seeds, seeds=2, **changed):
    return [build({**SPEC, **changed}, Protocol(seeds=seeds, first_seed=first)) for first in first_seeds]


def test_shards_of_one_cell_are_planned_as_one_and_their_rows_joined(tmp_path):
    assert [list(one.draws) for one in planned(shards(0, 2, 7)).jobs] == [[0, 1, 2, 3, 7, 8]]
    assert [list(one.draws) for one in planned(shards(0, 2, seeds=4)).jobs] == [list(range(6))]
    store = Store(tmp_path)
    for seeds in ((2, 3), (0, 1), (3, 4, 5)):
        write_blocks(store, [RowBlock("a", len(seeds), [row(float(seed), seed) for seed in seeds], about(notes=[]))])
        write_manifest(tmp_path, {"a": seeds}, [], ["jerkbench"])
    store_cell(store, "d", [row(9.0, 9)], about(notes=[], created="2025-01-01T00:00:00Z"))
    study = load_study(tmp_path)
    assert list(study.rows["seed"]) == [0, 1, 3, 4, 5]
    assert set(study.keys) == {"a"}
    assert study.combinations == 1
    assert "1 stored run is left out: the last command used other seeds." in study.notes
    assert "1 result of the same name with other settings, code or data is left out." in study.notes


@pytest.mark.parametrize("name", ["tilt", "gyro_only"])
def test_a_combination_whose_yaw_source_the_recording_lacks_is_left_out_before_anything_runs(name):
    dataset = {"name": "field", "duration_s": 20.0}
    there = build({**SPEC, "dataset": dataset, "attitude": {"name": name, "yaw_source": "dual_antenna"}}, Protocol())
    absent = build({**SPEC, "dataset": dataset, "attitude": {"name": name, "yaw_source": "odometry"}}, Protocol())

    plan = planned([there, absent])
    assert [job.key for job in plan.jobs] == [there.key]
    assert "Left out 1 combination" in plan.refused[0]
    assert "dual_antenna" in plan.refused[0]
    with pytest.raises(RecordingError, match="dual_antenna"):
        planned([absent])


@pytest.mark.parametrize(("first", "second", "words"), UNLIKE.values(), ids=UNLIKE)
def test_two_studies_that_were_not_measured_alike_are_not_compared(tmp_path, first, second, words):
    put(tmp_path / "A", "1", 3.36, conditions=first)
    put(tmp_path / "B", "2", 23.8, conditions=second)

    with pytest.raises(JerkbenchError, match=re.escape(words)):
        require_alike(load_study(tmp_path / "A"), load_study(tmp_path / "B"))


def test_two_versions_of_a_method_are_compared_and_that_they_differ_is_said(tmp_path):
    for name, sigma in (("A", 0.1), ("B", 1.0)):
        put(tmp_path / name, "1", sigma, conditions={"spec": {"filter": {"name": "jerk", "accel_mps2": sigma}}})
    both = load_study(tmp_path / "A"), load_study(tmp_path / "B")

    require_alike(*both)
    assert other_methods(*both) == ["A and B differ in filter.accel_mps2 (0.1, 1.0)."]


def test_results_of_several_kinds_of_processors_say_so(tmp_path):
    for key, kind in zip(KEYS_OF_TWO, ("znver4: avx fma", "haswell: avx"), strict=True):
        put(tmp_path, key, 1.0, processor=kind, filter=f"filter{key[0]}")
    notes = load_study(tmp_path).notes
    assert "These results come from 2 kinds of processors (haswell, znver4): last bits may differ." in notes
    store = Store(tmp_path / "b")
    store.prepare()
    for seed, kind in enumerate(("znver4: avx fma", "haswell: avx")):
        write_blocks(store, [RowBlock(KEYS_OF_TWO[0], 2, [row(seed=seed)], about(processor=kind))])
    (stored,), _ = store.read([KEYS_OF_TWO[0]])
    assert stored.metadata["processor"] == "haswell: avx and znver4: avx fma"


def test_a_method_that_loses_to_the_fixes_alone_or_diverged_is_named(tmp_path):
    errors = {"gnss_only": 5.0, "baseline": 11.9, "eskf15": 0.7, "bias": 5.2}
    for attitude, factor in (("real", 1.0), ("reference", 0.1)):
        for name, error in errors.items():
            scaled = error if name == "gnss_only" else error * factor
            key = f"{name}{attitude}".encode().hex()
            put(tmp_path, key, scaled, filter=name, attitude=attitude)
    losing = load_study(tmp_path).notes[-1]
    assert losing.startswith("Worse than gnss_only, which has no IMU: ")
    assert losing.endswith("none, real: baseline.")
    put(tmp_path / "b", "a1", 5.0, filter="gnss_only")
    put(tmp_path / "b", "b1", 0.1, filter="jerk")
    for key, name, status in (("c1", "bias", "diverged"), ("d1", "imm", "failed")):
        lost = [row(float("nan"), status=status, filter=name)]
        store_cell(Store(tmp_path / "b"), key, lost, about(labels={**LABELS, "filter": name}))
    told = [note for note in load_study(tmp_path / "b").notes if "gnss_only" in note]
    assert len(told) == 1
    assert ": bias." in told[0]
    assert "imm" not in told[0]


def window(value, **more):
    return {"spec": {"adaptation": {"name": "mtf", "window": value}}, **more}


EQUAL = {"spec": {"filter": {"name": "eskf15"}}}


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({"adaptation": "mtf", "conditions": window(2)}, {"adaptation": "mtf(window=1)", "conditions": window(1)}),
        ({"filter": "eskf15_drive", "conditions": EQUAL}, {"filter": "eskf15", "conditions": EQUAL}),
    ],
)
def test_methods_with_other_parameters_and_other_presets_keep_their_names(tmp_path, first, second):
    put(tmp_path, "a", 0.1, **first)
    put(tmp_path, "b", 0.2, **second)

    (factor,) = first.keys() - {"conditions"}
    assert set(load_study(tmp_path).rows[factor]) == {first[factor], second[factor]}


def test_a_method_told_twice_has_one_name(tmp_path):
    """`mtf` and `mtf(window=1)` are the same: of both results the newer one is shown, and nothing is compared."""
    put(tmp_path, "a", 0.1, adaptation="mtf", conditions=window(1, created="2026-02-01T00:00:00Z"))
    put(tmp_path, "b", 0.2, seeds=2, adaptation="mtf(window=1)", conditions=window(1, created="2026-01-01T00:00:00Z"))
    put(tmp_path, "c", 0.3, adaptation="mtf(window=4)", conditions=window(4))

    study = load_study(tmp_path)

    assert dict(zip(study.keys, study.rows["adaptation"], strict=True)) == {"a": "mtf", "c": "mtf(window=4)"}
    assert study.labels["a"]["adaptation"] == "mtf"
    assert study.unlike == ()
