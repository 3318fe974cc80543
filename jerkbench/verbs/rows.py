"""The verbs of single rows: `rerun` and `export` run a stored one again, `score` adds those of trajectories."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.verbs.arguments import RUN_PROGRAMS, argument, output, verb

if TYPE_CHECKING:
    from jerkbench.results.replay import StoredRow

DIFFERENT = 1
"""Exit code where a number is another."""

ROW = (
    argument("folder", type=Path, help="a study's folder, or a folder of cells"),
    argument("row", metavar="ROW", help="its number in rows.csv, from 1; or KEY:SEED of a file in cells/"),
    RUN_PROGRAMS,
)
"""The words that say which row."""


@verb(*ROW)
def rerun_verb(chosen: argparse.Namespace) -> None:
    """Run one row again, from its own stored configuration: the same numbers?.

    Raises:
        JerkbenchError: there is no such row, or its data have changed.
        SystemExit: 1, where a number is another.
    """
    from jerkbench.report.tables.terminal import print_grid
    from jerkbench.results.replay import equal_or_nan, replay_differences, stored_row

    row = stored_row(chosen.folder, chosen.row, run_programs=chosen.run_programs)
    numbers = replay_differences(row)
    lines = [[name, repr(a), repr(b), "" if equal_or_nan(a, b) else "differs"] for name, a, b in numbers]
    notes = ["The code or a library is another than when the row was stored."] if row.code_changed else []
    print_grid(f"{', '.join(row.job.labels)}, {row.row['replicate']} {row.draw}", ["", "was", "is", ""], lines, notes)
    differing = sum(not equal_or_nan(a, b) for _, a, b in numbers)
    print(f"{differing} of {len(numbers)} numbers differ.")
    if differing:
        raise SystemExit(DIFFERENT)


NOTHING_ASKED = (
    "What is to be exported? Give --tum FOLDER for trajectories, --updates FILE.csv for the adapted R, or both."
)


@verb(
    *ROW,
    argument("--tum", type=output, metavar="FOLDER", help="write estimate.tum, reference.tum"),
    argument(
        "--updates", type=output, metavar="FILE.csv", help="write each update: innovation, NIS, the R that was used"
    ),
)
def export_verb(chosen: argparse.Namespace) -> None:
    """Write one row's trajectories (TUM), or its updates with the adapted R.

    Raises:
        JerkbenchError: nothing is, there is no such row, its data have changed, or it has no reference or no updates.
    """
    from jerkbench.results.replay import stored_row
    from jerkbench.results.tum import write_updates

    if chosen.tum is None and chosen.updates is None:
        raise JerkbenchError(NOTHING_ASKED)
    row = stored_row(chosen.folder, chosen.row, run_programs=chosen.run_programs)
    if chosen.tum is not None:
        _write_trajectories(chosen, row)
    if chosen.updates is not None:
        _, estimate = row.run()
        write_updates(chosen.updates, estimate.updates)
        print(chosen.updates)


def _write_trajectories(chosen: argparse.Namespace, row: "StoredRow") -> None:
    from jerkbench.evaluation.counted_rows import counted_rows
    from jerkbench.results.tum import write_tum_pair

    recording, estimate = row.run()
    counted = counted_rows(estimate, recording, row.job.scoring.burn_in_s)
    for path in write_tum_pair(chosen.tum, recording, estimate, counted):
        print(path)


SCORE = """\
KEY=VALUE are those of `jerkbench run`: they say which recording it is (dataset, disturbance, and their parameters,
first_seed), how it is scored (burn_in_s, metrics), and where the rows go (study, results); name=NAME is what tables
call the method, and filter.KEY=VALUE says which columns are what (`jerkbench show filter trajectory`).

  jerkbench score mine.tum dataset=field disturbance=gnss_outage name=mine study=duel
  jerkbench score 'run_{seed}.csv' dataset=field name=mine study=duel filter.frame=ned
"""

WORD = re.compile(r"[+~]*[A-Za-z_][\w./@]*=")

NAME = "name="


@verb(
    argument(
        "words",
        nargs="+",
        metavar="FILE | KEY=VALUE",
        help="a trajectory (.tum, .csv, .parquet, .nav of KF-GINS, a bag); for each seed one, or a pattern with {seed}",
    ),
    epilog=SCORE,
)
def score_verb(chosen: argparse.Namespace) -> None:
    """Score trajectories from anywhere, as rows beside those of our filters.

    Raises:
        JerkbenchError: no file is given or there is none, or the words describe no recording.
    """
    from jerkbench.hydra_app.app import score_files
    from jerkbench.hydra_app.words import composed
    from jerkbench.io.trajectory_files import SEED, pattern_of, seeds_of

    words = [word for word in chosen.words if WORD.match(word)]
    files = [word for word in chosen.words if not WORD.match(word)]
    if not files:
        raise JerkbenchError("No trajectory is given; name its file, or a pattern with {seed} in place of the seed.")
    pattern = pattern_of(files)
    seeds = list(seeds_of(pattern)) if SEED in pattern else [_first_seed(words)]
    if not seeds:
        raise JerkbenchError(f"There is no trajectory {pattern}; correct its name.")
    label = next((word.removeprefix(NAME) for word in words if word.startswith(NAME)), "")
    others = [word for word in words if not word.startswith(NAME)]
    score_files(composed(["filter=trajectory", *_seed_words(seeds, words), *others]), pattern, label)


def _first_seed(words: list[str]) -> int:
    typed = [word.partition("=")[2] for word in words if word.startswith("first_seed=")]
    return int(typed[-1]) if typed and typed[-1].isdecimal() else 0


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
