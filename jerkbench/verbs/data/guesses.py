"""The answer of `jerkbench data inspect FILE.csv`: guesses with reasons, the facts that follow, a preset to edit."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError, RecordingError

if TYPE_CHECKING:
    from jerkbench.contracts import Dataset
    from jerkbench.inspection.guess.guessing import Draft
    from jerkbench.recording import Recording

SUFFIX = ".csv"

Describe = Callable[["Recording", "Dataset", Path | None], None]


def guesses_columns(chosen: argparse.Namespace) -> bool:
    """Whether the source is a table whose columns nobody named.

    Raises:
        JerkbenchError: a preset was asked for, of something else.
    """
    path = Path(chosen.source).expanduser()
    guesses = path.suffix.lower() == SUFFIX and chosen.dataset is None and path.is_file()
    if chosen.preset is not None and not guesses:
        raise JerkbenchError(f"--preset is written for a .csv whose columns are guessed, and {chosen.source} is none.")
    return guesses


def print_guesses(chosen: argparse.Namespace, describe: Describe) -> None:
    """Print the guesses, write the preset, and describe the recording that they make.

    Raises:
        RecordingError: the columns cannot be told by their names.
        JerkbenchError: the preset is there already.
    """
    from jerkbench.datasets.table import Tables
    from jerkbench.inspection.guess.guessing import guess_table

    draft = guess_table(Path(chosen.source).expanduser())
    _print(draft)
    if chosen.preset is not None:
        _write(draft, chosen.preset)
    print()
    try:
        recording = draft.load()
    except RecordingError as error:  # what the guesses lack is an answer
        print(f"No recording can be made of it as it is: {error}")
    else:
        describe(recording, Tables(**draft.settings), chosen.figure)


def _print(draft: "Draft") -> None:
    for guess in draft.guesses.values():
        print(guess)
    if draft.unused:
        print(f"not used: {', '.join(draft.unused)}; columns of an attitude or of the truth go to reference_...")
    unsure = [guess.parameter for guess in draft.guesses.values() if guess.grade == "unsure"]
    print(f"Say yourself: {', '.join(unsure)}." if unsure else "Nothing is unsure.")


def _write(draft: "Draft", preset: Path) -> None:
    from jerkbench.files import write_atomically
    from jerkbench.inspection.guess.preset import preset_path, preset_text

    path = preset_path(preset)
    if path.exists():
        raise JerkbenchError(f"{path} is there already; delete it or give another name.")
    path.parent.mkdir(parents=True, exist_ok=True)
    text = preset_text(draft, path.stem)
    write_atomically(path, lambda partial: partial.write_text(text, encoding="utf-8"))
    folder = path.parent.parent
    print(f"Preset: {path}. Correct it, then: jerkbench run --config-dir {folder} dataset={path.stem}")
