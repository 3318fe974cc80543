"""The commands of the pages of docs/, typed on shorter drives; pages that need more have a test of their own."""

import os
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

import pages
from commands import jerkbench, verb

SHORTER = {
    "run": ["dataset.duration_s=60", "seeds=2", "workers=1", "figures=false"],
    "tune": ["dataset.duration_s=60", "trials=2", "tune_seeds=1", "choose_seeds=1", "test_seeds=2", "finalists=1"],
    "report": ["--figures", "none"],
}
"""Words behind those of a page, by verb."""

TYPED = {
    "first_table": [],
    "own_filter": [
        "engine=filterpy",
        "seeds=1",
        "dataset=field_white",
        "dataset.imu_rate_hz=20",
        "dataset.reference_rate_hz=20",
    ],
    "attitude_filter": ["dataset=field_white", "dataset.imu_rate_hz=20", "dataset.reference_rate_hz=20"],
    "baseline": [],
    "faults": ["dataset.duration_s=90", "seeds=1"],
    "gate": ["dataset.duration_s=12", "engine=filterpy"],
    "report": [],
}
"""The pages that are typed here, with more words for their runs."""


@pytest.fixture(scope="module")
def typed(tmp_path_factory):
    """Types a page, once: returns its folder."""
    folders = {}

    def type_page(page):
        if page not in folders:
            folders[page] = _type(page, tmp_path_factory.mktemp(page))
        return folders[page]

    return type_page


def _type(page, folder):
    _prepare(page, folder)
    for words in pages.commands(page):
        done = _typed(words, TYPED[page], folder)
        assert done.returncode == 0, (words, done.stderr, done.stdout)
        assert done.stdout
        if words[0] == "new":
            package = words[2]
            _write(folder, {name: text for name, text in pages.files(page).items() if name.startswith(f"{package}/")})
            pages.install(folder / package)
    return folder


def _prepare(page, folder):
    """What the reader has, or writes first."""
    if page == "gate":
        shutil.copytree(pages.DOCS.parent / "examples" / "plugin", folder / "benchmarks" / "plugin")
        pages.install(folder / "benchmarks" / "plugin")
        _write(folder, pages.files(page))


def _typed(words, more, folder):
    words = [*words, *SHORTER.get(words[0], [])]
    if words[0] not in {"run", "tune"}:
        return verb(*words, cwd=folder)
    packages = os.pathsep.join(str(place.parent) for place in folder.rglob("pyproject.toml"))
    if not packages:
        return verb(*words, *more, cwd=folder)
    return jerkbench(*words, *more, cwd=folder, PYTHONPATH=packages)


def _write(folder, files):
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("page", TYPED)
def test_every_command_goes_well(typed, page):
    studies = {re.search(r"study=(\w+)", line)[1] for line in pages.lines(page) if "study=" in line}

    assert {path.name for path in typed(page).rglob("*") if path.is_dir()} >= studies


@pytest.mark.slow
def test_filters_of_the_reader_stand_beside_ours(typed):
    rows = pd.read_csv(typed("own_filter") / "results" / "mine" / "rows.csv")

    assert set(rows["status"]) == {"ok"}
    assert {"gentle", "restless", "mtf"} <= set(rows["adaptation"])
    assert {"held", "wearing_off", "baseline"} <= set(rows["filter"])


def test_the_first_page_installs_as_the_readme_does():
    readme = (pages.DOCS.parent / "README.md").read_text(encoding="utf-8")

    assert "\n".join(pages.lines("first_table")[:2]) in readme


def test_no_page_is_left_untyped():
    tests = (path.read_text(encoding="utf-8") for path in Path(__file__).parent.rglob("test_*.py"))
    elsewhere = {page for text in tests for page in re.findall(r'pages\.\w+\("(\w+)"', text)}
    told = {path.stem for path in pages.DOCS.glob("*.md") if pages.lines(path.stem)}

    assert told - elsewhere - set(TYPED) == set()


def test_every_block_says_its_language():
    for page in pages.DOCS.glob("*.md"):
        openings = re.findall(r"^```(.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)[::2]
        assert set(openings) <= {"sh", "python", "yaml", "toml", "text"}, page.name


def test_python_of_a_page_is_a_file_of_it():
    """So that it is run."""
    assert [page.name for page in pages.DOCS.glob("*.md") if pages.blocks(page.stem, "python")] == []
