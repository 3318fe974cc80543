"""The commands of the pages in docs, and their links, pictures and outputs."""

import json
import os
import re
import shlex
import shutil
import sys
from pathlib import Path

import pandas as pd
import pytest

import pages
from commands import jerkbench, standing_program, verb

AT_20_HZ = ["dataset=field_white", "dataset.imu_rate_hz=20", "dataset.reference_rate_hz=20"]
TYPED = {
    **{
        page: []
        for page in ("index", "installation", "sweeps", "first_table", "baseline", "faq", "report", "statistics")
    },
    "own_filter": ["engine=filterpy", "seeds=1", *AT_20_HZ],
    "attitude_filter": AT_20_HZ,
    "faults": ["dataset.duration_s=90", "seeds=1"],
    "gate": ["dataset.duration_s=12", "engine=filterpy"],
}
"""Pages whose commands run here, with additional arguments of their runs."""

ELSEWHERE = {"agents", "any_language", "suite"}
"""Pages whose outputs are checked by a separate test module."""


@pytest.fixture(scope="module")
def typed(tmp_path_factory):
    """Return a function that runs the commands of a page once and returns the working folder."""
    folders = {}

    def type_page(page):
        if page not in folders:
            folders[page] = _type(page, tmp_path_factory.mktemp(page))
        return folders[page]

    return type_page


def _type(page, folder):
    _prepare(page, folder)
    shown = pages.outputs(page)
    for line in (line for line in pages.lines(page) if line.startswith("jerkbench ")):
        words = shlex.split(line)[1:]
        shorter = words[0] in {"figures", "report"} or TYPED[page] or not _is_quoted(line, shown)
        more = pages.SHORTER.get(words[0], []) if shorter else ["workers=1"] if words[0] in {"run", "tune"} else []
        more = [word for word in more if "dataset=mixture" not in words or "duration_s" not in word]
        done = _typed([*words, *more], TYPED[page], folder)
        assert done.returncode == 0, (words, done.stderr, done.stdout)
        assert done.stdout
        assert pages.agree(shown.get(line, "..."), done.stdout), f"{line}\n{done.stdout}"
        if words[0] == "new":
            package = words[2]
            _write(folder, {name: text for name, text in pages.files(page).items() if name.startswith(f"{package}/")})
            pages.install(folder / package)
    return folder


def _is_quoted(line, shown):
    """Whether the page shows an output of the command, or of another command on the same study."""
    study = re.search(r"study=(\w+)", line)
    return any(line == other or (study and re.search(rf"(study=|results/){study[1]}\b", other)) for other in shown)


def _prepare(page, folder):
    """Create the files that a page expects."""
    if page == "gate":
        shutil.copytree(pages.DOCS.parent / "examples" / "plugin", folder / "benchmarks" / "plugin")
        pages.install(folder / "benchmarks" / "plugin")
        _write(folder, pages.files(page))
    if page == "attitude_filter":
        _write(folder, {name: text for name, text in pages.files(page).items() if "/" not in name})


def _typed(words, more, folder):
    if words[0] not in {"run", "tune", "suite"} or words[1] in {"verify", "board"}:
        return verb(*words, cwd=folder)
    packages = os.pathsep.join(str(place.parent) for place in folder.rglob("pyproject.toml"))
    if not packages:
        return verb(*words, *more, cwd=folder)
    more = ["--workers", "1"] if words[0] == "suite" else more
    return jerkbench(*words, *more, cwd=folder, PYTHONPATH=packages)


def _write(folder, files):
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("page", TYPED)
def test_every_command_succeeds(typed, page):
    studies = {re.search(r"study=(\w+)", line)[1] for line in pages.lines(page) if "study=" in line}

    assert {path.name for path in typed(page).rglob("*") if path.is_dir()} >= studies


@pytest.mark.slow
def test_plugins_of_a_page_are_rows_of_the_table(typed):
    rows = pd.read_csv(typed("own_filter") / "results" / "mine" / "rows.csv")

    assert set(rows["status"]) == {"ok"}
    assert {"gentle", "restless", "mtf"} <= set(rows["adaptation"])
    assert {"held", "wearing_off", "baseline"} <= set(rows["filter"])


@pytest.mark.slow
def test_a_mistake_is_reported_as_on_the_page(typed, tmp_path):
    shutil.copytree(typed("own_filter") / "gentle", tmp_path / "gentle")
    module = tmp_path / "gentle" / "gentle.py"
    module.write_text(module.read_text().replace("return adapted\n", "return adapted[:1]\n"))
    done = jerkbench("check", "gentle", cwd=tmp_path)

    assert done.returncode == 1
    assert done.stdout in pages.blocks("own_filter", "text")


def test_the_first_page_installs_as_the_readme_does():
    readme = (pages.DOCS.parent / "README.md").read_text(encoding="utf-8")

    assert "\n".join(pages.lines("first_table")[:2]) in readme


def test_every_output_of_a_page_is_checked():
    shown = {path.stem for path in pages.DOCS.glob("*.md") if "<!-- output -->" in path.read_text(encoding="utf-8")}

    assert shown <= {*TYPED, *ELSEWHERE}
    for page in shown:
        assert pages.text(page).count("<!-- output -->") == len(pages.outputs(page))
        assert set(pages.outputs(page)) <= set(pages.lines(page))


def test_every_picture_is_drawn_by_the_script_and_used():
    script = (pages.DOCS.parent / "docs_build" / "pictures.py").read_text(encoding="utf-8")
    shown = {name for page in pages.DOCS.glob("*.md") for name in re.findall(r"\]\(img/(\S+)\)", page.read_text())}

    assert shown == {path.name for path in (pages.DOCS / "img").iterdir()}
    assert all(f'"{name}"' in script for name in shown)


def test_the_commands_of_every_page_are_run():
    tests = (path.read_text(encoding="utf-8") for path in Path(__file__).parent.rglob("test_*.py"))
    elsewhere = {page for text in tests for page in re.findall(r'pages\.\w+\("(\w+)"', text)}
    with_commands = {path.stem for path in pages.DOCS.glob("*.md") if pages.lines(path.stem)}

    assert with_commands - elsewhere - set(TYPED) == set()


def test_every_block_has_a_language_and_python_is_a_file_so_that_it_is_run():
    for page in pages.DOCS.glob("*.md"):
        openings = re.findall(r"^```(.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)[::2]
        assert set(openings) <= {"sh", "python", "yaml", "toml", "text"}, page.name
    assert [page.name for page in pages.DOCS.glob("*.md") if pages.blocks(page.stem, "python")] == []


def test_links_lead_to_files_of_a_clone():
    link = re.compile(r"\]\((?!https?:|#)([^)#\s]+)")
    found = [
        (page, page.parent / target)
        for page in (*pages.DOCS.rglob("*.md"), *(pages.DOCS.parent / "experiments").glob("*/README.md"))
        for target in link.findall(re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL))
    ]

    assert len(found) > 100
    assert [(page.name, target.name) for page, target in found if not target.exists()] == []


def test_the_numbers_of_which_filter_are_in_their_sources():
    row = re.compile(r"^\|.*?(\d\.\d\d \[\d\.\d\d, \d\.\d\d\]).*\]\((\S+?\.md)[#)].*\|$", re.MULTILINE)
    numbers = row.findall(pages.text("which_filter"))

    assert len(numbers) > 15
    for interval, source in numbers:
        assert interval in (pages.DOCS / source).read_text(encoding="utf-8"), interval


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the reader types, after the installation: a plugin that `jerkbench new` made, and a program."""
    folder = tmp_path_factory.mktemp("reader")
    assert verb("new", "adaptation", "mine", cwd=folder).returncode == 0
    pages.install(folder / "mine")
    standing_program(folder / "my_filter")
    return folder


@pytest.mark.slow
def test_the_commands_of_the_page_go_well(folder):
    shown = pages.outputs("suite")
    for line in (line for line in pages.lines("suite") if line.startswith("jerkbench ")):
        words = shlex.split(line)[1:]
        alone = ["--workers", "1"] if "run" in words else []
        done = jerkbench(*words, *alone, cwd=folder, PYTHONPATH=str(folder / "mine"))
        assert done.returncode == 0, done.stderr + done.stdout
        assert pages.agree(shown.get(line, "..."), done.stdout), done.stdout

    assert "my_filter" in (folder / "results/suite-v2-tiny/board.md").read_text(encoding="utf-8")


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
    typed = [line for line in pages.lines("own_log") if line.startswith("jerkbench ")]
    return folder, {line: typed_log(shlex.split(line)[1:], folder) for line in typed}


def typed_log(words, folder):
    return verb(*words, *(["workers=1", "figures=false"] if words[0] in ("run", "tune") else []), cwd=folder)


def errors_of(table):
    """The first number behind the name of each filter."""
    lines = (line.split() for line in table.splitlines() if line.startswith((" e", " g", " j")))
    return {name: float(error) for name, error, *_ in lines}


@pytest.mark.slow
def test_every_command_of_own_log_goes_well_and_prints_what_the_page_shows(reader):
    for line, done in reader[1].items():
        assert done.returncode == 0, (line, done.stderr)
    said = next(iter(reader[1].values())).stdout
    shown = [
        line
        for line in pages.text("own_log").splitlines()
        if line.startswith(("measured  ", "named     ", "Uncertain, "))
    ]
    assert len(shown) == 8
    assert all(line in said for line in shown), [line for line in shown if line not in said]
    assert "jerkbench run --config-dir . dataset=my_drive" in said
    folder, done = reader
    table = next(finished.stdout for line, finished in done.items() if "outage_end_m" in line)
    errors_m = errors_of(table)
    assert errors_m["eskf15"] < 0.1 * errors_m["gnss_only"]
    shown = pages.text("own_log").split("end of an outage, mean over the outages [m]")[1].split("```")[0]
    assert {
        name: float(line.split()[1]) for line in shown.splitlines() for name in errors_m if f" {name} " in line
    } == errors_m
    assert (folder / "results/first/tune/baseline-none/export/robot_localization.yaml").is_file()
    words = ("data", "inspect", "gnss.csv", "--preset", "my_drive.yaml")
    assert "dataset/my_drive.yaml already exists" in verb(*words, cwd=reader[0]).stderr
    assert "field is not such a table" in verb("data", "inspect", "field", "--preset", "a.yaml", cwd=reader[0]).stderr
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
    assert "mistakes: none found" in mended
    words = ["--config-dir", ".", "dataset=my_bag", "study=bag", "figures=false", "workers=1"]
    done = verb("run", "-m", "filter=gnss_only,eskf15", "metrics=[position_rmse,outage]", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    table = verb("table", "results/bag", "--metric", "outage_end_m", cwd=tmp_path).stdout
    errors_m = errors_of(table)
    assert errors_m["eskf15"] < 0.1 * errors_m["gnss_only"]
    tuned = verb("tune", "filter=bias", "objective=rmse", "split=time", "trials=4", *words, cwd=tmp_path)
    assert tuned.returncode == 0, tuned.stderr
    assert (tmp_path / "results/bag/tune/bias-none/export/robot_localization.yaml").is_file()


PAGE = pages.text("agents")
WORDS = pages.commands("agents")


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Each command of the page with its finished process."""
    folder = tmp_path_factory.mktemp("program")
    return {" ".join(words): verb(*words, cwd=folder) for words in WORDS}


@pytest.mark.slow
def test_every_command_of_agents_goes_well(answers):
    assert len(answers) > 8
    for command, done in answers.items():
        assert done.returncode == 0, (command, done.stderr)
        assert done.stdout, command


def test_answers_are_those_of_the_page_and_strict_json(answers):
    shown = pages.outputs("agents")
    assert len(shown) > 3
    for line, part in shown.items():
        assert pages.agree(part, answers[line.removeprefix("jerkbench ")].stdout), line

    def refuse(word):
        pytest.fail(f"{word} is no JSON")

    for command, done in answers.items():
        if command.endswith("json"):
            json.loads(done.stdout, parse_constant=refuse)
    table = json.loads(answers["table results/tried --format json"].stdout)
    fields = re.search(r"`cells` describes one combination with these fields:\n\n.*?\n\n", PAGE, re.DOTALL)[0]
    named = {
        name
        for line in fields.splitlines()
        if line.startswith("| `")
        for name in re.findall(r"`(\w+)`", line.split("|")[1])
    }
    assert set(table["cells"][0]) == named
    assert set(table) == {"title", "metric", "unit", "row_keys", "column_keys", "baseline", "cells", "footnotes"}


def test_the_links_of_the_short_index_lead_to_files():
    links = re.findall(r"\]\(([^)]+)\)", (ROOT / "llms.txt").read_text(encoding="utf-8"))

    assert len(links) > 5
    assert [link for link in links if not (ROOT / link).is_file()] == []
