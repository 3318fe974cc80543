"""The examples of --help, and completion."""

import re
import shlex
import shutil
import subprocess
import sys

import pytest

from commands import environment, swept, verb
from jerkbench.cli import RUN_HELP, parser

NOT_RUN = ("jerkbench data fetch broad", "jerkbench audit")
"""These examples need the network, delete compiled code, or take minutes. Their options are parsed."""

FIRST = "data convert"
"""Its examples write the files that other examples read."""

TUNING = ["trials=1", "tune_seeds=1", "choose_seeds=0", "test_seeds=1", "figures=false", "workers=1"]

SMALL = {
    "report": ["--figures", "none", "--scenarios", "0"],
    "figures": ["--methods", "baseline"],
    "tune": TUNING,
    "score": ["seeds=1"],
    "run": ["seeds=1", "figures=false", "workers=1"],
}
"""Arguments that make the examples of a command fast; the last value of an option counts."""

REPLACED = {
    "run -m experiment=paper": "run -m experiment=paper --dry",
    "adaptation=my_rule": "adaptation=mtf",
    "suite run ": "suite run --scale v2-tiny ",
    " --scale v1": "",
    "attitude-v1": "attitude-tiny",
}
"""Parts of examples that take long, or that name a plugin of the reader."""

PROGRAM = """\
#!/bin/sh
awk -F, 'NR == 1 { print "t_s,east_m,north_m,up_m,qw,qx,qy,qz" }
         NR > 1 { print $1 ",0,0,0,1,0,0,0" }' "$1" > "$2"
"""
"""A filter that estimates no motion."""


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
    for name in ("mine.tum", "truth.tum"):
        verb("data", "convert", "field", name, cwd=folder)
    estimates = "".join(f"{k / 10},0,0,0\n" for k in range(601))
    (folder / "run_0.csv").write_text(f"t_s,north_m,east_m,down_m\n{estimates}")
    (folder / "mine").write_text(PROGRAM)
    (folder / "mine").chmod(0o755)
    return folder


@pytest.mark.slow
def test_the_examples_go_well(folder):
    """In their order: some read what one before them wrote."""
    texts = {" ".join(words): own.epilog or "" for words, own in verbs(parser())} | {"run": RUN_HELP}
    for name in sorted(texts, key=lambda name: (name != FIRST, list(texts).index(name))):
        lines = re.findall(r"^  (jerkbench .*?)(?:  .*)?$", texts[name], re.MULTILINE)
        assert len(lines) >= 2
        for line in lines:
            assert line == f"jerkbench {name}" or line.startswith(f"jerkbench {name} ")
            if line.startswith(NOT_RUN):
                parser().parse_args(shlex.split(line)[1:])
                continue
            for part, other in REPLACED.items():
                line = line.replace(part, other)  # noqa: PLW2901 - the example as it is run here
            done = verb(*shlex.split(line)[1:], *SMALL.get(name, []), cwd=folder)
            assert done.returncode == 0, (line, done.stderr)
            assert done.stdout, line


pytest.importorskip("argcomplete")


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("jerkbench data fe", {"fetch"}),
        ("jerkbench tune --mul", {"--multirun"}),
        ("jerkbench run exp", {"experiment="}),
        ("jerkbench run filter=const", {"filter=constant_turn", "filter=constant_velocity"}),
        ("jerkbench suite run adaptation=mtf_", {"adaptation=mtf_block", "adaptation=mtf_nis"}),
    ],
)
def test_commands_options_and_plugins_are_offered(line, offered, tmp_path):
    reply = tmp_path / "reply"
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_STDOUT_FILENAME": str(reply), "_ARGCOMPLETE_IFS": "\n"}
    asked |= {"COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_COMP_WORDBREAKS": " \t"}
    subprocess.run([sys.executable, "-m", "jerkbench"], env=environment(**asked), check=False, timeout=300)

    assert {word.strip() for word in reply.read_text(encoding="utf-8").splitlines()} == offered
