"""`jerkbench score`: trajectories from anywhere, as rows of a study."""

import argparse
import re

from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.verbs.arguments import Verbs, add_verb

EPILOG = """\
KEY=VALUE are those of `jerkbench run`: they say which recording it is (dataset, disturbance, and their parameters,
first_seed), how it is scored (burn_in_s, metrics), and where the rows go (study, results); name=NAME is what tables
call the method, and filter.KEY=VALUE says which columns are what (`jerkbench show filter trajectory`).

  jerkbench score mine.tum dataset=field disturbance=gnss_outage name=mine study=duel
  jerkbench score 'run_{seed}.csv' dataset=field name=mine study=duel filter.frame=ned
"""

WORD = re.compile(r"[+~]*[A-Za-z_][\w./@]*=")
NAME = "name="


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    score = add_verb(verbs, "score", "score trajectories from anywhere, as rows beside those of our filters", answer)
    score.formatter_class = argparse.RawDescriptionHelpFormatter
    score.epilog = EPILOG
    score.add_argument(
        "words",
        nargs="+",
        metavar="FILE | KEY=VALUE",
        help="a trajectory (.tum, .csv, .parquet, .nav of KF-GINS, a bag); for each seed one, or a pattern with {seed}",
    )


def answer(chosen: argparse.Namespace) -> None:
    """Score the trajectories, store the rows, and print them.

    Raises:
        JerkbenchError: no file is given or there is none, or the words describe no recording.
    """
    from jerkbench.hydra_app.scoring import score
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
    score(composed(["filter=trajectory", *_seed_words(seeds, words), *others]), pattern, label)


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
