"""Our own entries in results/suite-v1: whole, on the board with their score, and a row computed again."""

import re
import shutil
from pathlib import Path

import pytest

from commands import verb
from jerkbench.suite.board import file_mistakes, frozen_mistakes, missing_mistakes, score_mistakes
from jerkbench.suite.entry import ENTRY_FILE, read_entry
from jerkbench.suite.protocol import read_suite
from jerkbench.suite.scores import ByPosition

FOLDER = Path(__file__).parents[2] / "results" / "suite-v1"
ENTRIES = sorted(path.parent for path in FOLDER.glob(f"*/{ENTRY_FILE}"))


@pytest.mark.parametrize("folder", ENTRIES, ids=lambda folder: folder.name)
def test_a_committed_entry_is_whole_and_its_score_is_that_of_its_rows(folder):
    entry, protocol = read_entry(folder), read_suite("v1")

    assert [*frozen_mistakes(entry, protocol), *file_mistakes(entry), *missing_mistakes(entry, protocol)] == []
    assert list(score_mistakes(entry, protocol)) == []
    assert entry.manifest["tuned"]
    assert not entry.manifest["git_commit"].endswith("+changes")


def test_the_board_shows_every_entry_with_its_score():
    protocol, board = read_suite("v1"), (FOLDER / "board.md").read_text(encoding="utf-8")
    shown = re.findall(
        r"^\| \d+ \(\d+ to \d+\) \| (.*?) \| ([\d.]+) \[([\d.]+), ([\d.]+)\] \|", board, flags=re.MULTILINE
    )
    scores = {(entry := read_entry(folder)).name: ByPosition(protocol).score(entry.rows) for folder in ENTRIES}

    assert {name: (low, ratio, high) for name, ratio, low, high in shown} == {
        name: tuple(f"{value:.3f}" for value in (score["low"], score["ratio"], score["high"]))
        for name, score in scores.items()
    }
    assert [float(ratio) for _, ratio, _, _ in shown] == sorted(round(score["ratio"], 3) for score in scores.values())
    assert board.count("| yes, 2 rows |") == len(ENTRIES) == 8


def test_rows_of_a_committed_entry_come_out_again_and_a_doctored_one_does_not(tmp_path):
    copy = tmp_path / "jerk-none"
    shutil.copytree(FOLDER / "jerk-none", copy)
    honest = verb("suite", "verify", str(copy), "--rows", "3", cwd=tmp_path)
    (copy / "entry.md").write_text((copy / "entry.md").read_text().replace("undecided", "better").replace("0.8", "0.4"))
    doctored = verb("suite", "verify", str(copy), "--rows", "0", cwd=tmp_path)

    assert honest.returncode == 0, honest.stdout
    assert "2 of its own rows were computed again" in honest.stdout
    assert doctored.returncode == 1
    assert "entry.md was changed after it was made" in doctored.stdout
