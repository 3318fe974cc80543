"""Every verb over damaged results: a sentence, never a traceback, and nothing that steers the terminal."""

import json
import os
import re
import shutil
import sys
import time
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image

from jerkbench.cli import main
from jerkbench.errors import JerkbenchError
from jerkbench.hydra_app.app import conclude_sweep, report_end
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.key import read_manifest
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import shared_inputs
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import load_study
from stored_cells import store_cell

DAMAGES = 20
BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
SPEC = {
    "dataset": {"name": "field", "duration_s": 8.0},
    "disturbance": [{"name": "none"}],
    "attitude": {"name": "tilt"},
    "filter": {"name": "baseline"},
    "engine": {"name": "compiled"},
    "metrics": ["position_rmse", "consistency"],
}


@pytest.fixture(scope="module")
def hostile():
    sys.path.insert(0, str(BENCHMARKS))
    yield import_module("hostile_results")
    sys.path.remove(str(BENCHMARKS))


@pytest.fixture(scope="module")
def plan():
    adaptations = ("none", "mtf")
    return planned([build({**SPEC, "adaptation": {"name": name}}, Protocol(seeds=2)) for name in adaptations])


def run(plan, folder):
    """Do what `jerkbench run -m` does once it knows its cells; each of them gets a part of its own."""
    store = Store(folder)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("jerkbench.jobs.run.MAX_FLUSH_S", 0.0)
        code = 0
        try:
            run_missing(plan, store)
        except (OSError, JerkbenchError) as error:
            code = report_end(error)
        patched.setattr(Store, "compact", lambda _: None)
        conclude_sweep(plan, None, code, store, SimpleNamespace(notes=["a note"], report=False))
    return code


@pytest.fixture(scope="module")
def whole(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    assert run(plan, folder) == 0
    return folder


def told(folder):
    """Return all that a verb can read of a study."""
    stored, broken = Store(folder).read()
    read = [[one.key, one.metadata, one.rows.to_csv()] for one in stored]
    try:
        study = load_study(folder)
        shown = [study.rows.to_csv(), list(study.keys), study.notes, study.code]
    except JerkbenchError as error:
        shown = str(error)
    return json.dumps([read, broken, shown, read_manifest(folder)])


def ending(words):
    try:
        main(words)
    except SystemExit as ended:
        return ended.code
    return 0


@pytest.fixture
def _undrawn(monkeypatch):
    """Figures are made, but not painted."""
    mpl.use("Agg")
    monkeypatch.setattr("jerkbench.report.plots.style.image_of", lambda _: Image.new("P", (1, 1)))


@pytest.mark.slow
@pytest.mark.filterwarnings("default::RuntimeWarning")  # forged values overflow: on the command line that is a line
@pytest.mark.usefixtures("_undrawn")
def test_no_verb_falls_over_damaged_results(whole, plan, hostile, tmp_path, capsys):
    """A verb whose input is the same as after another damage answers the same: it is asked once."""
    rng, seen = np.random.default_rng(3), set()
    for number in range(DAMAGES):
        folder = tmp_path / "study"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(whole, folder)
        what = hostile.damage(folder, rng)
        content = told(folder)
        if content not in seen:
            seen.add(content)
            for verb, words in hostile.words_for(folder, whole).items():
                if verb in ("report", "figures") and number % 4:
                    continue
                codes = (0, 2, 3, 4) if verb.startswith("compare") else (0, 1, 2)
                assert ending(words) in codes, (verb, what)
            printed = capsys.readouterr()
            assert "\x1b" not in printed.out + printed.err, what
    assert len(seen) > DAMAGES / 8


def test_a_damaged_study_is_run_again(whole, plan, hostile, tmp_path):
    rng = np.random.default_rng(4)
    for number in range(10):
        folder = tmp_path / f"study{number}"
        shutil.copytree(whole, folder)
        what = hostile.damage(folder, rng)
        assert run(plan, folder) in (0, 1), what
        assert {job.key for job in plan.jobs} <= set(load_study(folder).keys) | {"abc"}, what


@pytest.mark.parametrize("content", [b"[]", b"null", b'{"cells": 3}', b'{"last": [1]}', b"\xff{}", b"[" * 100_000, b""])
def test_a_damaged_manifest_stops_nothing_and_is_said(whole, tmp_path, capsys, content):
    folder = shutil.copytree(whole, tmp_path / "study")
    (folder / "manifest.json").write_bytes(content)

    assert ending(["table", str(folder)]) == 0
    printed = capsys.readouterr()
    assert "manifest.json is damaged" in printed.err
    assert "Position RMSE" in printed.out


@pytest.mark.parametrize(
    "missing",
    ["filter", "cell.spec.filter", "cell.protocol", "cell.notes", "cell.seconds", "cell.created", "cell.data"],
)
def test_a_signed_cell_that_lacks_something_is_damaged(whole, hostile, tmp_path, capsys, missing):
    folder = shutil.copytree(whole, tmp_path / "study")
    path = min((folder / "cells").iterdir())
    signed = hostile.sign(path, hostile.pq.read_table(path).drop([missing]))

    assert ending(["table", str(folder)]) == 0
    assert f"1 damaged file of results is left out: {signed.stem}." in capsys.readouterr().out


@pytest.mark.parametrize(
    ("column", "forged", "sentence"),
    [
        ("cell.spec.dataset", {"name": "field", "duration_s": 1e12}, "a simulated drive has at most"),
        ("cell.spec.dataset", {"name": "field", "position_sigma_m": [0.01] * 100_000}, "the maximum is 100000"),
        ("cell.spec.disturbance", [{"name": "none"}] * 10_000, "the maximum is 100000"),
        ("cell.spec.filter", {"name": "x" * 5_000_000}, "the maximum is 100000"),
        ("cell.spec.filter", {"name": "x" * 50_000}, "characters ...]"),
        ("cell.spec.adaptation", {"name": "cerkf_r", "passes": 10**12}, "must be from 1 to 1000"),
        (
            "cell.protocol",
            {"seeds": 10**9, "first_seed": 0, "burn_in_s": 5.0, "divergence_limit_m": 1000.0},
            "give 1 to 100000.",
        ),
    ],
)
def test_a_forged_configuration_of_any_size_is_refused_at_once(
    whole, hostile, tmp_path, capsys, column, forged, sentence
):
    folder = shutil.copytree(whole, tmp_path / "study")
    path = min((folder / "cells").iterdir())
    table = hostile.pq.read_table(path)
    place = table.column_names.index(column)
    values = hostile.pa.array(
        [json.dumps(forged), *table.column(column).to_pylist()[1:]], table.schema.field(column).type
    )
    hostile.sign(path, table.set_column(place, column, values))
    begun = time.monotonic()
    number = list(load_study(folder).keys).index(table["cell.key"][0].as_py()) + 1

    assert ending(["rerun", str(folder), str(number)]) == 2
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert len(printed.err) < 10_000
    assert time.monotonic() - begun < 10.0


def test_a_file_whose_name_is_no_key_runs_nothing_in_the_page(whole, tmp_path, capsys):
    folder = shutil.copytree(whole, tmp_path / "study")
    cells = sorted((folder / "cells").iterdir())
    shutil.copy(cells[0], folder / "cells" / '"><img src=x onerror=alert(1)>.parquet')
    cells[1].rename(folder / "cells" / "\x1b[2J.parquet")

    assert ending(["report", str(folder), "--scenarios", "0"]) == 0
    assert ending(["table", str(folder)]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<img src=x" not in page
    assert "2 damaged files of results are left out" in page
    printed = capsys.readouterr()
    assert "\x1b" not in page + printed.out + printed.err
    assert r"\x1b[2J" in printed.out


@pytest.mark.parametrize("what", ["mkfifo", "mkdir"])
def test_what_is_no_file_is_not_waited_for(whole, tmp_path, capsys, what):
    folder = shutil.copytree(whole, tmp_path / "study")
    for path in (min((folder / "cells").iterdir()), folder / "manifest.json"):
        path.unlink()
        getattr(os, what)(path)

    assert ending(["table", str(folder)]) == 0
    assert "1 damaged file of results is left out" in capsys.readouterr().out


def test_a_plugin_that_fails_in_an_export_is_a_sentence(whole, tmp_path, capsys, monkeypatch):
    shared_inputs.cache_clear()
    monkeypatch.setattr("jerkbench.jobs.rows.simulated", lambda *_: 1 / 0)

    assert ending(["export", str(whole), "1", "--tum", str(tmp_path)]) == 2
    assert re.search("failed: ZeroDivisionError", capsys.readouterr().err)


def test_a_method_without_any_error_has_no_ratio(whole, tmp_path):
    folder = tmp_path / "study"
    for one in Store(whole).read()[0]:
        store_cell(Store(folder), one.key, one.rows.assign(position_rmse_m=0.0).to_dict("records"), one.metadata)

    assert ending(["report", str(folder), "--scenarios", "0"]) == 0


def test_a_worker_that_died_is_not_told_as_a_result_that_cannot_be_stored(capsys):
    assert report_end(ChildProcessError("the process that ran it died")) == 1
    printed = capsys.readouterr().err
    assert "the process that ran it died" in printed
    assert "stored" not in printed
