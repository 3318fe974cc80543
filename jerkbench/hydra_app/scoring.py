"""Trajectories from elsewhere as a cell of a study: stored, and shown as a single run is."""

from jerkbench.cells.refusal import refusal
from jerkbench.errors import PluginError
from jerkbench.hydra_app.configuration import study_folder
from jerkbench.hydra_app.single_run import run_single, show_single
from jerkbench.hydra_app.words import Words
from jerkbench.sweep.sweep import plan_sweep


def score(words: Words, pattern: str, label: str) -> None:
    """Score the files of ``pattern``, store their rows, and print them.

    Args:
        words: the recording, the protocol and the study.
        pattern: a file, or one for each seed.
        label: what tables call the method; empty: the file's name.

    Raises:
        JerkbenchError: a file cannot be scored; nothing is stored then.
    """
    cell = words.cell(file=pattern, label=label)
    if reason := refusal(cell):
        raise PluginError(f"This combination makes no sense: {reason}.")
    plan, folder = plan_sweep([cell]), study_folder(words.config)
    show_single(plan, run_single(plan, folder), words.config)
    print(f"\nRows, tables and manifest: {folder}")
