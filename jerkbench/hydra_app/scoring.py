"""Trajectories from elsewhere as a cell of a study: stored, and shown as a single run is."""

import sys

from jerkbench.cells.refusal import refusal
from jerkbench.errors import PluginError
from jerkbench.hydra_app.configuration import study_folder
from jerkbench.hydra_app.single_run import run_single_cell
from jerkbench.hydra_app.words import Words
from jerkbench.results.manifest import write_manifest
from jerkbench.results.store import Store
from jerkbench.results.study import load_study, write_study
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
    from jerkbench.report.tables.terminal import print_run

    cell = words.cell(file=pattern, label=label)
    if reason := refusal(cell):
        raise PluginError(f"This combination makes no sense: {reason}.")
    (planned,) = plan_sweep([cell]).cells
    folder = study_folder(words.config)
    Store(folder).prepare()
    stored = run_single_cell(planned, folder)
    write_manifest(folder, [planned.key], list(words.config.notes), sys.argv)
    write_study(load_study(folder, prefer=[planned.key]))
    print_run(stored.rows)
    for note in stored.metadata["notes"]:
        print(note)
    print(f"\nRows, tables and manifest: {folder}")
