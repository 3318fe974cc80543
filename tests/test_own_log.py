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


def errors_of(table):
    """The first number behind the name of each filter."""
    lines = (line.split() for line in table.splitlines() if line.startswith((" e", " g", " j")))
    return {name: float(error) for name, error, *_ in lines}


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
    errors_m = errors_of(table)

    assert errors_m["eskf15"] < 0.1 * errors_m["gnss_only"]
    shown = pages.text("own_log").split("end of an outage, mean over the outages [m]")[1].split("```")[0]
    assert {
        name: float(line.split()[1]) for line in shown.splitlines() for name in errors_m if f" {name} " in line
    } == errors_m
    assert "Outages of a run with a known error at the end: 1." in table
    assert (folder / "results/first/tune/baseline-none/export/robot_localization.yaml").is_file()


@pytest.mark.slow
def test_a_preset_is_not_overwritten_and_belongs_to_a_csv(reader):
    words = ("data", "inspect", "gnss.csv", "--preset", "my_drive.yaml")
    assert "dataset/my_drive.yaml is there already" in verb(*words, cwd=reader[0]).stderr
    assert "is none." in verb("data", "inspect", "field", "--preset", "a.yaml", cwd=reader[0]).stderr


@pytest.mark.slow
def test_the_track_is_written(reader):
    folder, done = reader
    said = next(finished.stdout for line, finished in done.items() if line.startswith("jerkbench smooth"))

    assert said.startswith("Most likely over 1159 fixes: filter.model=")
    assert (folder / "track.gpx").read_text().count("<trkpt") == 1159
    assert (folder / "smooth.png").is_file()


@pytest.mark.slow
def test_the_preset_of_a_bag_reads_one_that_is_in_g_and_degrees(reader, tmp_path):
    """docs/one_bag.md: the log of docs/own_log.md as a driver would publish it."""
    from logs import car_bag

    folder, _ = reader
    car_bag(folder, tmp_path / "drive_bag")
    (tmp_path / "dataset").mkdir()
    (tmp_path / "dataset" / "my_bag.yaml").write_text(pages.files("one_bag")["dataset/my_bag.yaml"])
    mistakes = verb("data", "inspect", "drive_bag", "--set", "position_topic=/gps/fix", cwd=tmp_path).stdout
    mended = verb("data", "inspect", "my_bag", "--config-dir", ".", cwd=tmp_path).stdout

    for words in ("Set accel_unit=g", "Set gyro_unit=deg/s", "Set imu_axes=[x,-y,-z]"):
        assert words in mistakes
    assert "mistakes: none that is sure" in mended
    words = ["--config-dir", ".", "dataset=my_bag", "study=bag", "figures=false", "workers=1"]
    done = verb("run", "-m", "filter=gnss_only,eskf15", "metrics=[position_rmse,outage]", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    table = verb("table", "results/bag", "--metric", "outage_end_m", cwd=tmp_path).stdout
    errors_m = errors_of(table)
    assert errors_m["eskf15"] < 0.1 * errors_m["gnss_only"]
    tuned = verb("tune", "filter=bias", "objective=rmse", "split=time", "trials=4", *words, cwd=tmp_path)
    assert tuned.returncode == 0, tuned.stderr
    assert (tmp_path / "results/bag/tune/bias-none/export/robot_localization.yaml").is_file()
