"""A preset of the data set table, with the reason of each value beside it."""

import json
from pathlib import Path

from jerkbench.inspection.guess.guessing import Draft

HEAD = """\
# {name}: guessed from the columns of {file}. Correct what is unsure; `jerkbench show dataset table` lists the rest.
defaults:
  - table
  - _self_

folder: {folder}
separator: {separator}
"""


def preset_text(draft: Draft, name: str) -> str:
    """Return the preset; JSON's values are YAML's."""
    quoted = {key: json.dumps(draft.settings[key], ensure_ascii=False) for key in ("folder", "separator")}
    lines = [] if "imu_file" in draft.guesses else ['imu_file: "" # there is no IMU']
    for guess in draft.guesses.values():
        value = json.dumps(guess.value, ensure_ascii=False)
        lines.append(f"{guess.parameter}: {value} # {guess.grade}: {guess.why}")
    return HEAD.format(name=name, file=draft.path.name, **quoted) + "\n".join(lines) + "\n"


def preset_path(path: Path) -> Path:
    """Return where a preset of a data set has to stand for ``--config-dir``: in a folder `dataset`."""
    named = path.with_suffix(".yaml")
    return named if named.parent.name == "dataset" else named.parent / "dataset" / named.name
