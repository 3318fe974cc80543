"""The help text of every command, as the command line prints it."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
COLUMNS = "100"
"""Width of the help text, in characters."""


def commands_help() -> str:
    """Return a section with the help text of each command."""
    return "\n\n".join(f"## {name}\n\n```text\n{_help(name).rstrip()}\n```" for name in _names())


def _names() -> list[str]:
    """Return the commands in the order of the help text."""
    listed = re.findall(r"^    (\w+) {2,}\S", _help(), flags=re.MULTILINE)
    return [name for name in listed if not name.isupper()]


def _help(*command: str) -> str:
    """Return what ``jerkbench COMMAND --help`` prints."""
    words = [sys.executable, "-m", "jerkbench", *command, "--help"]
    environment = {**os.environ, "COLUMNS": COLUMNS, "PYTHONPATH": str(ROOT)}
    return subprocess.run(words, env=environment, capture_output=True, text=True, check=True).stdout  # noqa: S603
