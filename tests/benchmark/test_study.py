"""A study's folder: which of several results of the same name is shown, and what is said about the others."""

import pytest

from jerkbench.benchmark.cell import Protocol, build
from jerkbench.benchmark.store import Store
from jerkbench.benchmark.study import load_study, write_manifest, write_study
from jerkbench.benchmark.sweep import plan_sweep
from jerkbench.errors import JerkbenchError, PluginError, RecordingError

LABELS = {
    "dataset": "field",
    "disturbance": "none",
    "attitude": "field",
    "filter": "jerk",
    "adaptation": "none",
    "noise": "own",
}


def put(folder, key, rmse, created="2026-01-01T00:00:00Z", code="a", **labels):
    """Store a cell of one run."""
    named = {**LABELS, **labels}
    row = {**named, "seed": 0, "replicate": "seed", "status": "ok", "reason": "", "position_rmse_m": rmse}
    about = {"labels": named, "spec": {}, "protocol": {}, "data": "", "code": code, "versions": {}, "commit": ""}
    Store(folder).write(key, [row], {**about, "notes": [f"recording of {key}"], "created": created})


def shown(study):
    return dict(zip(study.keys, study.rows["position_rmse_m"], strict=True))


def test_of_two_results_of_one_name_the_planned_one_is_shown_even_if_it_is_older(tmp_path):
    put(tmp_path, "old", 0.1, created="2026-01-01T00:00:00Z")
    put(tmp_path, "new", 0.2, created="2026-02-01T00:00:00Z", code="b")

    assert shown(load_study(tmp_path)) == {"new": 0.2}
    assert shown(load_study(tmp_path, prefer=["old"])) == {"old": 0.1}
    write_manifest(tmp_path, ["old"], [], ["jerkbench"])
    assert shown(load_study(tmp_path)) == {"old": 0.1}
    write_study(load_study(tmp_path))  # it raised where two rows had one name


def test_what_is_not_shown_is_said(tmp_path):
    put(tmp_path, "old", 0.1)
    put(tmp_path, "new", 0.2, created="2026-02-01T00:00:00Z")
    put(tmp_path, "other", 0.3, code="b", filter="bias")
    Store(tmp_path).path("broken").write_bytes(b"PAR1")
    notes = load_study(tmp_path).notes

    assert "1 result of the same name with other settings, code or data is left out." in notes
    assert "These results come from 2 versions of the code or its libraries." in notes
    assert "1 damaged file of a cell is left out: broken." in notes


def test_notes_belong_to_the_cells_that_they_were_given_for(tmp_path):
    put(tmp_path, "one", 0.1)
    write_manifest(tmp_path, ["one"], ["a first note"], ["jerkbench"])
    write_manifest(tmp_path, ["one"], ["a corrected note"], ["jerkbench"])
    put(tmp_path, "two", 0.2, filter="bias")
    write_manifest(tmp_path, ["two"], ["a note on bias"], ["jerkbench"])

    assert load_study(tmp_path).notes == ("a corrected note", "a note on bias", "recording of one", "recording of two")


def test_rows_stand_in_the_order_of_the_sweeps(tmp_path):
    put(tmp_path, "b", 0.1, filter="bias")
    put(tmp_path, "a", 0.2, filter="jerk")
    write_manifest(tmp_path, ["b"], [], ["jerkbench"])
    write_manifest(tmp_path, ["a"], [], ["jerkbench"])

    assert list(load_study(tmp_path).keys) == ["b", "a"]


def test_a_folder_in_which_nothing_can_be_written_is_a_sentence(tmp_path):
    (tmp_path / "cells").write_text("a file where the folder should be")

    with pytest.raises(JerkbenchError, match="Results cannot be written to"):
        Store(tmp_path).prepare()


SPEC = {
    "dataset": {"name": "field"},
    "disturbance": [{"name": "none"}],
    "attitude": {"name": "tilt"},
    "filter": {"name": "baseline"},
    "adaptation": {"name": "none"},
    "engine": {"name": "filterpy"},
}


def test_two_combinations_that_the_table_could_not_tell_apart_are_refused_before_anything_runs():
    cells = [build({**SPEC, "engine": {"name": name}}, Protocol()) for name in ("filterpy", "compiled")]

    with pytest.raises(PluginError, match=r"both be called field, none, .* they differ in engine"):
        plan_sweep(cells)


@pytest.mark.parametrize("name", ["tilt", "gyro_only"])
def test_a_yaw_source_that_no_recording_has_ends_the_sweep_before_anything_runs(name):
    dataset = {"name": "field", "duration_s": 20.0}
    there = build({**SPEC, "dataset": dataset, "attitude": {"name": name, "yaw_source": "dual_antenna"}}, Protocol())
    absent = build({**SPEC, "dataset": dataset, "attitude": {"name": name, "yaw_source": "odometry"}}, Protocol())

    assert len(plan_sweep([there]).cells) == 1
    with pytest.raises(RecordingError, match="field has no odometry heading, its headings are of source dual_antenna"):
        plan_sweep([there, absent])
