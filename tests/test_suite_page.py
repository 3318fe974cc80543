"""The commands of docs/suite.md, typed, but for the installation."""

import shlex

import pytest

import pages
from commands import jerkbench, verb

PROGRAM = """\
#!/bin/sh
awk -F, 'NR == 1 { print "t_s,east_m,north_m,up_m" } NR > 1 { print $1 ",0,0,0" }' "$1" > "$2"
"""
"""Believes that it stands."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the reader types, after the installation: a plugin that `jerkbench new` made, and a program."""
    folder = tmp_path_factory.mktemp("reader")
    assert verb("new", "adaptation", "mine", cwd=folder).returncode == 0
    pages.install(folder / "mine")
    (folder / "my_filter").write_text(PROGRAM)
    (folder / "my_filter").chmod(0o755)
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
