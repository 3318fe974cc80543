"""The words that a shell offers through argcomplete."""

import subprocess
import sys

import pytest

from commands import environment

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
