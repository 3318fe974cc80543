"""The verbs of single runs: `rerun` and `export` run a stored one again, `score` adds those of other programs."""

import argparse
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

from jerkbench.cli.arguments import RUN_PROGRAMS, argument, output, verb
from jerkbench.errors import JerkbenchError, PluginError, RecordingError

DIFFERENT = 1
"""Exit code where a number is another."""

ROW_WORDS = (
    argument("folder", type=Path, help="a study's folder, or a folder of cells"),
    argument("row", metavar="ROW", help="its number in rows.csv, from 1; or KEY:SEED of a file in cells/"),
    RUN_PROGRAMS,
)
"""The words that say which row."""


@verb(*ROW_WORDS)
def rerun_verb(chosen: argparse.Namespace) -> None:
    """Run one row again from its stored configuration, and compare all numbers.

    Numbers with a relative difference of at most 1e-9 are equal.

      jerkbench rerun results/first 1
      jerkbench rerun results/first 12

    Raises:
        JerkbenchError: there is no such row, or its data have changed.
        SystemExit: 1, where a number is another.
    """
    from jerkbench.jobs.replay import SAME_WITHIN, relative_difference, replay_differences, stored_row
    from jerkbench.report.terminal import print_grid

    row = stored_row(chosen.folder, chosen.row, run_programs=chosen.run_programs)
    numbers = replay_differences(row)
    differences = [relative_difference(a, b) for _, a, b in numbers]
    marks = ["differs" if own > SAME_WITHIN else "" for own in differences]
    lines = [[name, repr(a), repr(b), mark] for (name, a, b), mark in zip(numbers, marks, strict=True)]
    notes = ["The code or a library is another than when the row was stored."] if row.code_changed else []
    print_grid(f"{', '.join(row.job.labels)}, {row.row['replicate']} {row.draw}", ["", "was", "is", ""], lines, notes)
    differing = marks.count("differs")
    largest = f"{max(differences, default=0.0):.2g}"
    print(f"{differing} of {len(numbers)} numbers differ. The largest relative difference is {largest}.")
    if differing:
        raise SystemExit(DIFFERENT)


@verb(
    *ROW_WORDS,
    argument("--tum", type=output, metavar="FOLDER", help="write estimate.tum, reference.tum"),
    argument(
        "--updates", type=output, metavar="FILE.csv", help="write each update: innovation, NIS, the R that was used"
    ),
)
def export_verb(chosen: argparse.Namespace) -> None:
    """Write the trajectories of one row (TUM), or its updates with the adapted R.

      jerkbench export results/first 1 --tum trajectories
      jerkbench export results/first 5 --updates updates.csv

    Raises:
        JerkbenchError: nothing is, there is no such row, its data have changed, or it has no reference or no updates.
    """
    from jerkbench.evaluation.counted_rows import counted_rows
    from jerkbench.jobs.replay import stored_row
    from jerkbench.report.run_files import write_tum_pair, write_updates

    if chosen.tum is None and chosen.updates is None:
        raise JerkbenchError(
            "What is to be exported? Give --tum FOLDER for trajectories, --updates FILE.csv for the adapted R, or both."
        )
    row = stored_row(chosen.folder, chosen.row, run_programs=chosen.run_programs)
    recording, estimate = row.run()
    if chosen.tum is not None:
        counted = counted_rows(estimate, recording, row.job.evaluation.burn_in_s)
        for path in write_tum_pair(chosen.tum, recording, estimate, counted):
            print(path)
    if chosen.updates is not None:
        write_updates(chosen.updates, estimate.updates)
        print(chosen.updates)


WORD = re.compile(r"[+~]*[A-Za-z_][\w./@]*=")

NAME_KEY = "name="


@verb(
    argument(
        "words",
        nargs="+",
        metavar="FILE | KEY=VALUE",
        help="a trajectory (.tum, .csv, .parquet, .nav of KF-GINS, a bag); for each seed one, or a pattern with {seed}",
    ),
    argument("--reference", type=Path, metavar="FILE", help="score against this trajectory (.tum, .pos, a table)"),
)
def score_verb(chosen: argparse.Namespace) -> None:
    """Score trajectories of other programs, as rows beside those of our filters.

    KEY=VALUE are those of `jerkbench run`. They name the recording (dataset, disturbance, their parameters,
    first_seed), the scoring (burn_in_s, metrics), and where the rows go (study, results). name=NAME is the name of the
    method in tables. filter.KEY=VALUE names the columns of the file (`jerkbench show filter trajectory`).

      jerkbench score mine.tum dataset=field disturbance=gnss_outage name=mine study=duel
      jerkbench score 'run_{seed}.csv' dataset=field name=mine study=duel filter.frame=ned
      jerkbench score mine.tum --reference truth.tum       on the reference's own clock and axes; nothing is aligned

    Raises:
        JerkbenchError: no file is given or there is none, or the words describe no recording.
    """
    from jerkbench.hydra_app.app import score_files
    from jerkbench.hydra_app.composition import composed
    from jerkbench.io.trajectory import SEED, pattern_of, seeds_of

    files = [word for word in chosen.words if not WORD.match(word)]
    words = [word for word in chosen.words if WORD.match(word)]
    if not files:
        raise JerkbenchError("No trajectory is given; name its file, or a pattern with {seed} in place of the seed.")
    pattern = pattern_of(files)
    typed = [word.partition("=")[2] for word in words if word.startswith("first_seed=")]
    first = int(typed[-1]) if typed and typed[-1].isdecimal() else 0
    seeds = list(seeds_of(pattern)) if SEED in pattern else [first]
    if not seeds:
        raise JerkbenchError(f"There is no trajectory {pattern}; correct its name.")
    label = next((word.removeprefix(NAME_KEY) for word in words if word.startswith(NAME_KEY)), "")
    others = [word for word in words if not word.startswith(NAME_KEY)]
    others = ["filter=trajectory", *_seed_words(seeds, words), *others]
    if chosen.reference is None:
        score_files(composed(others), pattern, label)
        return
    name = str(chosen.reference.name).replace("'", "\\'")
    dataset = ["dataset=table", f"dataset.reference_file='{name}'"]  # it names the recording in tables
    clock = ["filter.clock=unix"] if {chosen.reference.suffix, Path(files[0]).suffix} == {".tum"} else []
    settings = _reference_settings(chosen.reference.expanduser(), words)
    score_files(composed([*dataset, *clock, *others]), pattern, label, settings)


def _reference_settings(path: Path, words: list[str]) -> dict[str, Any]:
    """The parameters of `dataset=table` by which a trajectory alone is a recording; ``words`` may have others.

    Raises:
        RecordingError: there is no such file, or it has no places and times that are known by their names.
    """
    from jerkbench.datasets.table import Tables
    from jerkbench.inspection.guessing import guess_tables
    from jerkbench.io.trajectory import TUM

    if not path.is_file():
        raise RecordingError(f"There is no reference {path}; correct its name.")
    said: dict[str, Any] = {"folder": str(path.resolve().parent), "position_file": path.name}
    if path.suffix == ".tum":
        said |= TUM | {"position_time": TUM["time"], "position_columns": TUM["position"], "position_frame": "enu"}
    elif path.suffix != ".pos":
        said |= guess_tables(path).settings
    names = ("file", "time", "time_unit", "frame")
    said |= {f"reference_{name}": said[key] for name in names if (key := f"position_{name}") in said}
    said |= {"reference_position": said.get("position_columns", ()), "drop_leaps": False, "imu_file": ""}
    said |= {"velocity_file": "", "reference_independent": True, "reference_source": f"{path.name}, as it is given"}
    typed = {word.partition("=")[0].removeprefix("dataset.") for word in words}
    return {f.name: said[f.name] for f in fields(Tables) if f.name in said and f.name not in typed}


def _seed_words(seeds: list[int], words: list[str]) -> list[str]:
    """The seeds that there are files for; a word of the user's comes after, and decides.

    Raises:
        PluginError: a file between them is missing.
    """
    missing = sorted(set(range(seeds[0], seeds[-1] + 1)) - set(seeds))
    if missing and not any(word.startswith("seeds=") for word in words):
        raise PluginError(
            f"There are trajectories of the seeds {seeds[0]} to {seeds[-1]}, but none of {', '.join(map(str, missing))}"
            "; add it, or say which are scored: first_seed=... seeds=..."
        )
    return [f"first_seed={seeds[0]}", f"seeds={len(seeds)}"]
