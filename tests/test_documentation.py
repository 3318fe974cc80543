"""The commands of the README and of three pages, on shorter drives; the README's plugin is installed and swept."""

import re
import shlex
from pathlib import Path

import pytest

import pages
from commands import jerkbench, standing_program, verb

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TEXT = README + pages.text("sweeps") + pages.text("inspect") + pages.text("receiver")
BRIEF = ("data", "report", "new", "check", "compare", "cite")
"""Verbs of which some only name the file that they wrote."""
IN_FULL = pages.commands("sweeps")
"""They are typed by `test_pages.py`, which compares what they print."""
QUICK = ["dataset.duration_s=80", "seeds=1", "workers=1"]


def blocks(language, text=README):
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def commands():
    """Every `jerkbench` command, without those of the README that the project's gate runs as they are."""
    lines = [line for block in blocks("sh", TEXT) for line in block.splitlines()]
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("jerkbench ")]


def is_run(words):
    return words[0] == "run" and "--dry" not in words


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the reader types; with a filter and a bag of their own, and one that was cut."""
    folder = tmp_path_factory.mktemp("reader")
    verb("data", "convert", "field", "drive.bag", "--set", "duration_s=30", cwd=folder)
    standing_program(folder / "my_filter")
    whole = (folder / "drive.bag").read_bytes()
    (folder / "cut.bag").write_bytes(whole[: len(whole) // 2])
    return folder


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """The folder of the README's package: written by `jerkbench new`, with the class of the README, and installed."""
    folder = tmp_path_factory.mktemp("installed")
    verb("new", "adaptation", "doubt", cwd=folder)
    module = folder / "doubt" / "doubt.py"
    head = module.read_text(encoding="utf-8").partition("@dataclass")[0]
    module.write_text(head + blocks("python")[0], encoding="utf-8")
    pages.install(folder / "doubt")
    return str(folder / "doubt")


def typed(words, folder, plugin):
    """Run a command; in a process of its own, which finds the package, where it names what is in there."""
    if words[0] != "new" and "doubt" in " ".join(words):
        return jerkbench(*words, cwd=folder, PYTHONPATH=plugin)
    return verb(*words, cwd=folder)


@pytest.mark.slow
@pytest.mark.parametrize("words", [w for w in commands() if is_run(w) and w not in IN_FULL], ids=" ".join)
def test_the_runs_of_the_readme_go_well(folder, plugin, words):
    lasting = {"dataset=rosbag", "dataset=mixture"} & set(words)  # a drive that cannot be shortened
    quick = [word for word in QUICK if not lasting or not word.startswith("dataset.")]
    done = typed([*words, *quick], folder, plugin)

    assert done.returncode == 0, done.stderr
    assert "Position RMSE (3-D) [m]" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("words", [w for w in commands() if not is_run(w) and w not in IN_FULL], ids=" ".join)
def test_the_other_commands_of_the_readme_go_well(folder, plugin, words, tmp_path):
    folder = tmp_path if words[0] == "new" else folder  # its template would hide the plugin of the README
    if studies := [word for word in words if word.startswith("results/")]:  # of a sweep with outages
        study = f"study={Path(studies[0]).name}"
        sweep = ["run", "-m", "filter=baseline,jerk", "adaptation=none,mtf", "disturbance=gnss_outage", study]
        verb(*sweep, "dataset.duration_s=60", *QUICK[1:], cwd=folder)
    more = pages.SHORTER[words[0]] if words[0] in ("report", "tune") else []
    done = typed([*words, *more], folder, plugin)

    assert done.returncode == 0, done.stderr
    assert len(done.stdout) > (10 if words[0] in BRIEF else 200)


@pytest.mark.slow
def test_the_drive_of_its_study_goes_well(folder, shared_folder):
    page = (ROOT / "experiments" / "drive" / "README.md").read_text(encoding="utf-8")
    (words,) = [shlex.split(line)[1:] for line in page.splitlines() if line.startswith("jerkbench run")]
    drive = f"dataset.folder={shared_folder / 'data' / 'rtklib_drive_0708'}"
    less = ["filter=gnss_only", "adaptation=none", "noise.accel_mps2=0.2", "disturbance=withhold"]
    done = verb(*words[:-1], drive, *less, cwd=folder)

    assert words[-1] == "dataset.folder=FOLDER"
    assert done.returncode == 0, done.stderr
    assert "withheld from the filter; not independent" in done.stdout


def test_the_readme_is_short_and_its_two_commands_are_what_the_gate_runs():
    gate = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for name in ("main", "tests"):
        assert f"<!-- {name} -->\n```sh\npython3 -m venv .venv\n" in README
        assert f"readme {name}" in gate
    assert README.count("\n") <= 120


def test_the_python_of_the_page_of_sweeps_runs_and_asks_what_was_drawn(tmp_path, monkeypatch, capsys):
    (words,) = [words for words in pages.commands("sweeps") if "dataset=mixture" in words]
    done = verb(*words, "seeds=3", "workers=1", cwd=tmp_path)
    monkeypatch.chdir(tmp_path)
    exec(pages.files("sweeps")["by_faults.py"], {})  # noqa: S102 - our own page
    assert done.returncode == 0, done.stderr
    assert "drawn.faults\n2.0" in capsys.readouterr().out
    exec(pages.files("sweeps")["first_run.py"], {})  # noqa: S102 - our own page
    assert "outage_end_m" in capsys.readouterr().out
