"""The commands of docs/agents.md, typed, and its statements about the JSON."""

import json
import re
from pathlib import Path

import pytest

import pages
from commands import verb

ROOT = Path(__file__).parents[1]
PAGE = pages.text("agents")
WORDS = pages.commands("agents")


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Each command of the page with its finished process."""
    folder = tmp_path_factory.mktemp("program")
    return {" ".join(words): verb(*words, cwd=folder) for words in WORDS}


@pytest.mark.slow
def test_every_command_goes_well(answers):
    assert len(answers) > 8
    for command, done in answers.items():
        assert done.returncode == 0, (command, done.stderr)
        assert done.stdout, command


def test_it_is_what_the_page_shows(answers):
    shown = pages.outputs("agents")
    assert len(shown) > 3
    for line, part in shown.items():
        assert pages.agree(part, answers[line.removeprefix("jerkbench ")].stdout), line


def test_every_answer_in_json_is_one_strict_value(answers):
    def refuse(word):
        pytest.fail(f"{word} is no JSON")

    for command, done in answers.items():
        if command.endswith("json"):
            json.loads(done.stdout, parse_constant=refuse)


def test_a_cell_has_the_fields_of_the_page(answers):
    table = json.loads(answers["table results/tried --format json"].stdout)
    fields = re.search(r"A cell:\n\n.*?\n\n", PAGE, re.DOTALL)[0]
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
