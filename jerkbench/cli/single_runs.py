"""The commands for single runs. `rerun` and `export` repeat a stored run, and `score` adds runs of other programs."""

import argparse
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

from jerkbench.cli.arguments import RUN_PROGRAMS, argument, command, count
from jerkbench.errors import JerkbenchError, PluginError, RecordingError

DIFFERENT = 1
"""Exit code of `rerun` if a number differs."""

ROW_ARGUMENTS = (
    argument("folder", type=Path, help="a study's folder, or a folder of cells"),
    argument("row", type=count, metavar="ROW", help="number of the row in rows.csv (from 1)"),
    RUN_PROGRAMS,
)
"""The arguments that select a row of the stored results."""


@command(*ROW_ARGUMENTS)
def rerun_command(arguments: argparse.Namespace) -> None:
    """Run a row again from its stored configuration, and compare all numbers.

    Numbers are considered equal if their relative difference is at most 1e-9.

      jerkbench rerun results/first 1
      jerkbench rerun results/first 12

    Raises:
        JerkbenchError: The row does not exist, or its data have changed.
        SystemExit: 1 if a number differs.
    """
    from jerkbench.jobs.replay import SAME_WITHIN, relative_difference, replay_differences, stored_row
    from jerkbench.report.terminal import print_grid

    row = stored_row(arguments.folder, arguments.row, run_programs=arguments.run_programs)
    numbers = replay_differences(row)
    differences = [relative_difference(a, b) for _, a, b in numbers]
    marks = ["differs" if difference > SAME_WITHIN else "" for difference in differences]
    lines = [[name, repr(a), repr(b), mark] for (name, a, b), mark in zip(numbers, marks, strict=True)]
    notes = ["The code or a library has changed since the row was stored."] if row.code_changed else []
    title = f"{', '.join(row.job.labels)}, {row.row['replicate']} {row.draw}"
    print_grid(title, ["", "stored", "new", ""], lines, notes)
    differing = marks.count("differs")
    largest = f"{max(differences, default=0.0):.2g}"
    print(f"{differing} of {len(numbers)} numbers differ. The largest relative difference is {largest}.")
    if differing:
        raise SystemExit(DIFFERENT)


@command(
    *ROW_ARGUMENTS,
    argument("--tum", type=Path, metavar="FOLDER", required=True, help="write estimate.tum, reference.tum"),
)
def export_command(arguments: argparse.Namespace) -> None:
    """Write the trajectories of a stored run in the TUM format.

      jerkbench export results/first 1 --tum trajectories
      jerkbench export results/first 12 --tum other_trajectories

    Raises:
        JerkbenchError: The row does not exist, its data have changed, or the run has no reference.
    """
    from jerkbench.evaluation.counted_rows import counted_rows
    from jerkbench.jobs.replay import stored_row
    from jerkbench.report.writers import write_tum_pair

    row = stored_row(arguments.folder, arguments.row, run_programs=arguments.run_programs)
    recording, estimate = row.run()
    counted = counted_rows(estimate, recording, row.job.protocol.burn_in_s)
    for path in write_tum_pair(arguments.tum, recording, estimate, counted):
        print(path)


OVERRIDE = re.compile(r"[+~]*[A-Za-z_][\w./@]*=")

NAME_KEY = "name="


@command(
    argument("overrides", nargs="+", metavar="FILE | KEY=VALUE", help="trajectories, one for each seed or with {seed}"),
    argument("--reference", type=Path, metavar="FILE", help="reference trajectory (.tum, .pos, a table)"),
)
def score_command(arguments: argparse.Namespace) -> None:
    """Score trajectories of other programs, and add them to a study as rows.

    KEY=VALUE are arguments of `jerkbench run`, which define the recording (dataset, disturbance, their parameters,
    first_seed), the scoring (burn_in_s, metrics), and the study of the rows (study, results). name=NAME is the name of
    the method in tables. filter.KEY=VALUE defines the columns of the file (`jerkbench show filter trajectory`).

      jerkbench score mine.tum dataset=field disturbance=gnss_outage name=mine study=external
      jerkbench score 'run_{seed}.csv' dataset=field name=mine study=external filter.frame=ned
      jerkbench score mine.tum --reference truth.tum       both have the same clock and axes; nothing is aligned

    Raises:
        JerkbenchError: No file is given, a file does not exist, or the arguments do not define a recording.
    """
    from jerkbench.hydra_app.app import score_files
    from jerkbench.hydra_app.composition import composed
    from jerkbench.io.trajectory import SEED, pattern_of, seeds_of

    files = [given for given in arguments.overrides if not OVERRIDE.match(given)]
    overrides = [given for given in arguments.overrides if OVERRIDE.match(given)]
    if not files:
        raise JerkbenchError("No trajectory is given; give a file, or a pattern with {seed} such as 'run_{seed}.csv'.")
    pattern = pattern_of(files)
    typed = [override.partition("=")[2] for override in overrides if override.startswith("first_seed=")]
    first = int(typed[-1]) if typed and typed[-1].isdecimal() else 0
    seeds = list(seeds_of(pattern)) if SEED in pattern else [first]
    if not seeds:
        raise JerkbenchError(f"No file matches {pattern}; correct the pattern.")
    label = next((override.removeprefix(NAME_KEY) for override in overrides if override.startswith(NAME_KEY)), "")
    others = [override for override in overrides if not override.startswith(NAME_KEY)]
    others = ["filter=trajectory", *_seed_overrides(seeds, overrides), *others]
    if arguments.reference is None:
        score_files(composed(others), pattern, label)
        return
    name = str(arguments.reference.name).replace("'", "\\'")
    dataset = ["dataset=table", f"dataset.reference_file='{name}'"]  # the label in tables contains the name of the file
    clock = ["filter.clock=unix"] if {arguments.reference.suffix, Path(files[0]).suffix} == {".tum"} else []
    settings = _reference_settings(arguments.reference.expanduser(), overrides)
    score_files(composed([*dataset, *clock, *others]), pattern, label, settings)


def _reference_settings(path: Path, overrides: list[str]) -> dict[str, Any]:
    """Return the parameters of `dataset=table` for a recording that consists only of a reference trajectory.

    Parameters that the user has set with overrides are left out.

    Raises:
        RecordingError: The file does not exist, or its columns with time and position cannot be recognised.
    """
    from jerkbench.datasets.table import Tables
    from jerkbench.inspection.guessing import guess_tables
    from jerkbench.io.trajectory import TUM

    if not path.is_file():
        raise RecordingError(f"The reference {path} does not exist; correct the path.")
    settings: dict[str, Any] = {"folder": str(path.resolve().parent), "position_file": path.name}
    if path.suffix == ".tum":
        settings |= TUM | {"position_time": TUM["time"], "position_columns": TUM["position"], "position_frame": "enu"}
    elif path.suffix != ".pos":
        settings |= guess_tables(path).settings
    names = ("file", "time", "time_unit", "frame")
    settings |= {f"reference_{name}": settings[key] for name in names if (key := f"position_{name}") in settings}
    settings |= {"reference_position": settings.get("position_columns", ()), "drop_leaps": False, "imu_file": ""}
    settings |= {"velocity_file": "", "reference_independent": True, "reference_source": f"{path.name}, as it is given"}
    typed = {override.partition("=")[0].removeprefix("dataset.") for override in overrides}
    return {f.name: settings[f.name] for f in fields(Tables) if f.name in settings and f.name not in typed}


def _seed_overrides(seeds: list[int], overrides: list[str]) -> list[str]:
    """Return the overrides ``first_seed`` and ``seeds`` for the seeds of the trajectory files.

    Raises:
        PluginError: The file of a seed between the first and the last seed is missing.
    """
    missing = sorted(set(range(seeds[0], seeds[-1] + 1)) - set(seeds))
    if missing and not any(override.startswith("seeds=") for override in overrides):
        lacking = f"{', '.join(map(str, missing))} (of {seeds[0]} to {seeds[-1]})"
        raise PluginError(f"The files of the seeds {lacking} are missing; add these, or give first_seed=... seeds=...")
    return [f"first_seed={seeds[0]}", f"seeds={len(seeds)}"]
