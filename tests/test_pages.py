"""The commands of docs/ on shorter drives, and properties of all pages. Some pages have a separate test module."""

import os
import re
import shlex
import shutil
from pathlib import Path

import pandas as pd
import pytest

import pages
from commands import jerkbench, verb

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
        whole = shown and not TYPED[page] and words[0] not in {"figures", "report"}
        more = [] if whole else pages.SHORTER.get(words[0], [])
        done = _typed([*words, *more], TYPED[page], folder)
        assert done.returncode == 0, (words, done.stderr, done.stdout)
        assert done.stdout
        assert pages.agree(shown.get(line, "..."), done.stdout), f"{line}\n{done.stdout}"
        if words[0] == "new":
            package = words[2]
            _write(folder, {name: text for name, text in pages.files(page).items() if name.startswith(f"{package}/")})
            pages.install(folder / package)
    return folder


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


def test_every_block_has_a_language():
    for page in pages.DOCS.glob("*.md"):
        openings = re.findall(r"^```(.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)[::2]
        assert set(openings) <= {"sh", "python", "yaml", "toml", "text"}, page.name


def test_every_python_block_is_a_file_so_that_it_is_run():
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
