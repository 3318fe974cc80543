"""Seeds in blocks: what the words mean, when it ends, and that a stopped sweep goes on from the last look."""

import json

import pandas as pd
import pytest

from commands import swept
from jerkbench.errors import PluginError
from jerkbench.hydra_app.looks import typed
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import load_study
from jerkbench.report.comparisons import VerdictRule

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
    assert typed(word) == words


def test_less_than_the_first_look_is_refused():
    with pytest.raises(PluginError, match="first look"):
        typed("seeds=auto(max=5)")


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
    assert len(Store(folder).keys_from("")) == 2  # those of the last look alone
    levels = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["levels"]
    assert 0 < min(levels.values()) < 0.05
    assert VerdictRule().of(first.rows).level == min(levels.values())
    done = swept(*words, cwd=tmp_path)
    assert "2 of 2 cells are done already" in done.stderr
    pd.testing.assert_frame_equal(load_study(folder).rows, first.rows)
