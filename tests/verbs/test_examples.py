"""The examples of `--help`: each verb has two, and they go well."""

import re
import shlex
import shutil

import pytest

from commands import swept, verb
from jerkbench.verbs import parser

NOT_RUN = ("jerkbench data fetch broad", "jerkbench data cache --clear")
"""They need the network, and delete what the tests have compiled."""

DESCRIBED = ("tune", "audit", "compare", "score", "data export", "suite run", "run")
"""Verbs whose texts describe what takes long, or needs files of one's own."""

FIRST = "data convert"
"""Its examples write what those of others read."""

SMALL = {"report": ["--figures", "none", "--scenarios", "0"], "figures": ["--few"]}
"""Words behind an example that takes long."""


def verbs(parser, words=()):
    """The words of every verb that does something, and its parser."""
    groups = [action.choices for action in parser._subparsers._group_actions] if parser._subparsers else []
    if not groups:
        yield words, parser
    for name, other in (pair for group in groups for pair in group.items()):
        yield from verbs(other, (*words, name))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two studies, an entry of the suite, a bag that was cut, one after a power loss, and a track."""
    folder = tmp_path_factory.mktemp("examples")
    for study in ("first", "second"):
        words = ["filter=baseline,jerk", "adaptation=none,mtf", "disturbance=none,outliers", "seeds=2"]
        swept(*words, f"study={study}", cwd=folder)
    done = verb("suite", "run", "filter=jerk", "--scale", "v2-tiny", "--workers", "1", cwd=folder)
    assert done.returncode == 0, done.stderr
    verb("data", "convert", "field", "whole_drive.bag", "--set", "duration_s=12", cwd=folder)
    verb("data", "convert", "field", "ride.gpx", "--set", "duration_s=60", cwd=folder)
    whole = (folder / "whole_drive.bag").read_bytes()
    (folder / "cut.bag").write_bytes(whole[: len(whole) // 2])
    shutil.copy(folder / "cut.bag", folder / "drive.bag.active")
    return folder


@pytest.mark.parametrize("words", [words for words, _ in verbs(parser())], ids=" ".join)
def test_the_help_of_a_verb_has_two_examples(tmp_path, words):
    helped = verb(*words, "--help", cwd=tmp_path).stdout

    assert len(re.findall(r"^  +jerkbench ", helped, re.MULTILINE)) >= 2


@pytest.mark.slow
def test_the_examples_go_well(folder):
    """In their order: some read what one before them wrote."""
    texts = {" ".join(words): own.epilog or "" for words, own in verbs(parser())}
    for name in sorted(texts.keys() - {*DESCRIBED}, key=lambda name: (name != FIRST, list(texts).index(name))):
        lines = re.findall(r"^  (jerkbench .*)", texts[name], re.MULTILINE)
        assert len(lines) >= 2
        for line in lines:
            assert line == f"jerkbench {name}" or line.startswith(f"jerkbench {name} ")
            if line in NOT_RUN:
                continue
            done = verb(*shlex.split(line)[1:], *SMALL.get(name, []), cwd=folder)
            assert done.returncode == 0, (line, done.stderr)
            assert done.stdout, line
