"""The commands of docs/own_log.md, typed with a log of a simulated drive."""

import shlex
import sys
from pathlib import Path

import pytest

import pages
from commands import verb

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    """A folder with a log in g, degrees and mm, and each command of the page with its finished process."""
    sys.path.insert(0, str(ROOT / "tests" / "inspection"))
    from logs import car_log

    sys.path.pop(0)
    folder = tmp_path_factory.mktemp("reader")
    car_log(folder)
    (folder / "experiment").mkdir()
    (folder / "experiment" / "mine.yaml").write_text(pages.blocks("own_log", "yaml")[0])
    return folder, {line: typed(shlex.split(line)[1:], folder) for line in pages.lines("own_log")}


def typed(words, folder):
    return verb(*words, *(["workers=1", "figures=false"] if words[0] in ("run", "tune") else []), cwd=folder)


@pytest.mark.slow
def test_every_command_goes_well(reader):
    for line, done in reader[1].items():
        assert done.returncode == 0, (line, done.stderr)


@pytest.mark.slow
def test_the_guess_says_its_reasons_and_what_is_unsure(reader):
    said = next(iter(reader[1].values())).stdout

    shown = [
        line for line in pages.text("own_log").splitlines() if line.startswith(("measured  ", "named     ", "Say "))
    ]

    assert len(shown) == 8
    assert all(line in said for line in shown), [line for line in shown if line not in said]
    assert "jerkbench run --config-dir . dataset=my_drive" in said


@pytest.mark.slow
def test_the_logs_own_outage_is_scored_and_its_settings_are_written(reader):
    folder, done = reader
    table = next(finished.stdout for line, finished in done.items() if "outage_end_m" in line)
    errors_m = {
        line.split()[0]: float(line.split()[1]) for line in table.splitlines() if line.startswith((" e", " g", " j"))
    }

    assert errors_m["eskf15"] < 0.1 * errors_m["gnss_only"]
    assert "Outages of a run with a known error at the end: 1." in table
    assert (folder / "results/first/tune/bias-none/export/robot_localization.yaml").is_file()


@pytest.mark.slow
def test_a_preset_is_not_overwritten_and_belongs_to_a_csv(reader):
    words = ("data", "inspect", "gnss.csv", "--preset", "my_drive.yaml")
    assert "dataset/my_drive.yaml is there already" in verb(*words, cwd=reader[0]).stderr
    assert "is none." in verb("data", "inspect", "field", "--preset", "a.yaml", cwd=reader[0]).stderr
