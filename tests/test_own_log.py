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
    """A folder with a log in NED and degrees, and each command of the page with its finished process."""
    from jerkbench.datasets.field_white import FieldWhite

    sys.path.insert(0, str(ROOT / "tests" / "inspection"))
    from logs import ned_degrees

    sys.path.pop(0)
    folder = tmp_path_factory.mktemp("reader")
    ned_degrees(FieldWhite(duration_s=100.0).load(0), units=True).to_csv(folder / "drive.csv", index=False)
    (folder / "experiment").mkdir()
    (folder / "experiment" / "mine.yaml").write_text(pages.blocks("own_log", "yaml")[0])
    return folder, {line: typed(shlex.split(line)[1:], folder) for line in pages.lines("own_log")}


def typed(words, folder):
    return verb(*words, *(["workers=1", "figures=false"] if words[0] == "run" else []), cwd=folder)


@pytest.mark.slow
def test_every_command_goes_well(reader):
    for line, done in reader[1].items():
        assert done.returncode == 0, (line, done.stderr)


@pytest.mark.slow
def test_the_guess_says_its_reasons_and_what_is_unsure(reader):
    said = next(iter(reader[1].values())).stdout

    assert "measured  gyro_unit = deg/s: the track turns 0.01" in said
    assert "measured  position_frame = ned" in said
    assert "Say yourself: position_sigma_m, velocity_sigma_mps." in said
    assert "jerkbench run --config-dir . dataset=my_drive" in said
    assert "gravity is felt on +z" in said


@pytest.mark.slow
def test_a_preset_is_not_overwritten_and_belongs_to_a_csv(reader):
    words = ("data", "inspect", "drive.csv", "--preset", "my_drive.yaml")
    assert "dataset/my_drive.yaml is there already" in verb(*words, cwd=reader[0]).stderr
    assert "is none." in verb("data", "inspect", "field", "--preset", "a.yaml", cwd=reader[0]).stderr
