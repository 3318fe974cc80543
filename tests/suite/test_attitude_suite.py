"""The suite of attitude filters: what is frozen, scores whose answer is known, an entry from command to check."""

import json
import re
import shutil
import sys
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from commands import verb
from jerkbench.errors import RecordingError
from jerkbench.io.files import VARIABLE
from jerkbench.suite.board import Board, file_mistakes, frozen_mistakes, html, missing_mistakes, score_mistakes
from jerkbench.suite.campaign import half_settings, seen
from jerkbench.suite.entry import ENTRY_FILE, read_entry
from jerkbench.suite.protocol import FROZEN, data_digests, read_suite, require_recordings
from jerkbench.suite.scores import BoardValue, ByTilt, entry_scoring

DIGESTS = {"attitude-v1": "5255c08c840d", "attitude-tiny": "6dc25bed7045"}
PROTOCOL = read_suite("attitude-v1")
FACTORS = {
    "plain": {"given": 2.0} | dict.fromkeys(PROTOCOL.searches, 1.0),
    "entry": {"given": 3.0, "hand first": 0.5, "hand second": 0.8, "drive first": 0.25, "drive second": 4.0},
}
"""Error of each setting over the tuned plain filter's."""

TINY = ["--scale", "attitude-tiny", "--workers", "1"]


def rows(lost=()):
    rng, made = np.random.default_rng(5), []
    for number, scenario in enumerate(PROTOCOL.scenarios):
        for seed in PROTOCOL.seeds_of(scenario, PROTOCOL.seeds_to_test_on):
            common = np.exp(rng.normal(0.0, 0.3))
            for method, factors in FACTORS.items():
                for tuned_on in half_settings(dict.fromkeys(factors, ()), scenario.half):
                    away = (method, number, tuned_on) in lost
                    head = {"method": method, "tuned_on": tuned_on, "scenario": number, "seed": seed}
                    error = np.nan if away else common * factors[tuned_on]
                    status = "diverged" if away else "ok"
                    made.append({**head, "status": status, "seconds": 0.1, "inclination_rmse_deg": error})
    return pd.DataFrame(made)


@pytest.mark.parametrize("scale", DIGESTS)
def test_the_protocols_are_those_that_were_frozen(scale):
    protocol, frozen = read_suite(scale), FROZEN[scale]

    assert protocol.digest == frozen.protocol == DIGESTS[scale]
    assert protocol.searches == frozen.searches
    assert len(frozen.data) == len(protocol.scenarios)


def test_the_simulated_data_are_those_that_were_frozen():
    protocol = read_suite("attitude-tiny")

    assert tuple(islice(data_digests(protocol), 3)) == FROZEN["attitude-tiny"].data


def test_without_the_trials_it_says_how_to_fetch_them(monkeypatch, tmp_path):
    monkeypatch.setenv(VARIABLE, str(tmp_path))

    with pytest.raises(RecordingError, match="jerkbench data fetch broad"):
        require_recordings("attitude-v1", PROTOCOL)


def test_domains_are_tuned_and_scored_apart_and_no_trial_is_scored_on_its_own_half():
    settings = dict.fromkeys(["given", *PROTOCOL.searches], ())
    for search in PROTOCOL.searches:
        looked_at = {PROTOCOL.scenarios[k].name for k in seen(search, PROTOCOL.scenarios)}
        scored_on = {s.name for s in PROTOCOL.scenarios if search in half_settings(settings, s.half)}
        assert {name.partition(",")[0] for name in looked_at | scored_on} == {search.partition(" ")[0]}
        assert looked_at & scored_on == ({"drive, none"} if search.startswith("drive") else set())


def test_each_domain_has_the_ratio_of_what_was_tuned_on_the_other_half():
    """Ten trials of each half; of a drive two faults with each setting, and `none` with the mean of both."""
    score = ByTilt(PROTOCOL).scores(rows())

    assert score["hand"]["n"] == 20
    assert score["hand"]["ratio"] == pytest.approx(np.sqrt(0.5 * 0.8), rel=1e-12)
    assert score["drive"]["n"] == PROTOCOL.test_seeds
    assert score["drive"]["ratio"] == pytest.approx(1.0, rel=1e-12)
    assert [score[domain]["given"] for domain in ("hand", "drive")] == pytest.approx([3.0, 3.0], rel=1e-12)
    ratios = ByTilt(PROTOCOL).ratios(rows(), "hand")
    np.testing.assert_allclose(ratios, np.log([0.8] * 10 + [0.5] * 10), rtol=1e-12)  # the first half comes first


def test_a_lost_run_counts_a_half_turn_and_a_hundred_times_what_the_plain_filter_has_as_it_comes():
    score = ByTilt(PROTOCOL).scores(rows(lost={("entry", 3, "hand second")}))["hand"]

    assert (score["worst_deg"], score["worst"]) == (pytest.approx(180.0), PROTOCOL.scenarios[3].fault)
    assert score["lost"] == pytest.approx(1 / 20)
    assert score["ratio"] == pytest.approx((0.5**10 * 0.8**9 * 200.0) ** (1 / 20), rel=1e-9)


def test_the_board_says_each_domain_and_what_it_ranks_by():
    scoring = entry_scoring(PROTOCOL)

    assert len(scoring.fields(rows())) == len(scoring.heads) == 10
    assert {name: cost.shape for name, cost in scoring.costs(rows()).items()} == {
        "hand: rank (95 %)": (20, 1),
        "drive: rank (95 %)": (16, 1),
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder in which an attitude filter was entered, what was said, and its entry."""
    folder = tmp_path_factory.mktemp("suite")
    done = verb("suite", "run", "attitude=mahony", *TINY, cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout, folder / "results/suite-attitude-tiny/mahony"


def test_the_boards_page_says_of_each_domain_who_beats_the_plain_filter():
    heads = ("hand: rank (95 %)", "entry", "hand: verdict", "drive: verdict")
    lines = [[BoardValue("1"), BoardValue("vqf"), BoardValue("better"), BoardValue("worse")]]
    page = html(Board("attitude-v1", "two domains", heads, lines, []))

    assert "hand: 1 of 1 entries beat the tuned plain filter: vqf<" in page
    assert "drive: 0 of 1 entries beat the tuned plain filter<" in page
    assert "<strong>vqf</strong>" in page


def test_an_entry_has_its_settings_and_comes_out_again(made):
    folder, out, entry = made
    settings = yaml.safe_load((entry / "settings.yaml").read_text())
    done = verb("suite", "verify", str(entry), "--rows", "6", cwd=folder)

    assert re.match(r"mahony on attitude-tiny, drive \(n = 3\): [\d.]+ of the tuned plain filter", out)
    assert set(settings["entry"]) == {"given", "drive first", "drive second"}
    assert set(settings["plain"]["given"]) >= {"attitude.accel_density", "attitude.bias"}
    assert done.returncode == 0, done.stdout
    assert "4 of its own rows were computed again" in done.stdout


def test_a_changed_error_is_found(made, tmp_path):
    copy = shutil.copytree(made[2], tmp_path / "entry", ignore=shutil.ignore_patterns("runs"))
    rows = pd.read_parquet(copy / "rows.parquet")
    rows.loc[rows["method"] == "entry", "inclination_rmse_deg"] *= 0.9
    rows.to_parquet(copy / "rows.parquet", index=False)

    done = verb("suite", "verify", str(copy), "--rows", "0", cwd=tmp_path)

    assert done.returncode == 1
    assert "The manifest says drive ratio =" in done.stdout


def test_a_setting_of_no_search_is_found(made, tmp_path):
    copy = shutil.copytree(made[2], tmp_path / "entry", ignore=shutil.ignore_patterns("runs"))
    settings = yaml.safe_load((copy / "settings.yaml").read_text())
    settings["entry"]["drive second"]["attitude.proportional_per_s"] *= 1.01
    (copy / "settings.yaml").write_text(yaml.safe_dump(settings, sort_keys=False))

    done = verb("suite", "verify", str(copy), "--rows", "3", cwd=tmp_path)

    assert done.returncode == 1
    assert "is none that the search of attitude-tiny tries" in done.stdout


def test_a_program_enters_by_its_quaternions(made):
    folder = made[0]
    shutil.copy(Path(__file__).parents[2] / "examples/any_language/madgwick.py", folder)
    command = f"filter.command='{sys.executable} madgwick.py {{recording}} {{out}}'"

    done = verb("suite", "run", "filter=attitude_command", command, *TINY, "--name", "mine", cwd=folder)
    unasked = verb("suite", "verify", "results/suite-attitude-tiny/mine", "--rows", "3", cwd=folder)

    assert done.returncode == 0, done.stderr
    assert "not tuned." in done.stdout
    assert unasked.returncode == 2
    assert "does not run unasked" in unasked.stderr


@pytest.mark.parametrize("word", ["adaptation=mtf", "dataset=field", "filter=jerk"])
def test_what_is_no_attitude_filter_cannot_enter(tmp_path, word):
    done = verb("suite", "run", word, *TINY, cwd=tmp_path)

    assert done.returncode == 2
    assert "not part of a method" in done.stderr or "no attitude filter" in done.stderr


FOLDER = Path(__file__).parents[2] / "results" / "suite-attitude-v1"
ENTRIES = sorted(path.parent for path in FOLDER.glob(f"*/{ENTRY_FILE}"))


@pytest.mark.parametrize("folder", ENTRIES, ids=lambda folder: folder.name)
def test_a_committed_entry_is_whole_and_its_score_is_that_of_its_rows(folder):
    entry = read_entry(folder)

    assert [*frozen_mistakes(entry, PROTOCOL), *file_mistakes(entry), *missing_mistakes(entry, PROTOCOL)] == []
    assert list(score_mistakes(entry, PROTOCOL)) == []
    assert not entry.manifest["git_commit"].endswith("+changes")


def test_the_board_shows_every_committed_entry_with_its_score():
    board = (FOLDER / "board.md").read_text(encoding="utf-8")
    for folder in ENTRIES:
        score = json.loads((folder / ENTRY_FILE).read_text())["score"]
        assert f"{score['hand ratio']:.3f} [{score['hand low']:.3f}, {score['hand high']:.3f}]" in board
        assert f"{score['drive ratio']:.3f} [{score['drive low']:.3f}, {score['drive high']:.3f}]" in board
    assert len(ENTRIES) >= 4
