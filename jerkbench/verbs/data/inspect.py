"""`jerkbench data inspect`: the streams of a recording, and their faults."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.verbs.arguments import Verbs, add_verb, output
from jerkbench.verbs.data.guesses import guesses_columns, print_guesses
from jerkbench.verbs.data.source import add_source, dataset_of

if TYPE_CHECKING:
    from jerkbench.contracts import Dataset
    from jerkbench.recording import Recording

SHIFTS = ("imu_shift_s", "position_latency_s", "velocity_latency_s", "position_shift_s", "velocity_shift_s")
"""Parameters of data sets that move stamps to the time when the values were true."""

FIGURES = (".pdf", ".png", ".svg")


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    inspect = add_verb(verbs, "inspect", "print what a recording is made of, and what is wrong with it", answer)
    add_source(inspect)
    inspect.add_argument(
        "--figure", type=Path, metavar="FILE", help="draw an overview of the recording too (.png, .pdf)"
    )
    inspect.add_argument(
        "--preset", type=output, metavar="NAME.yaml", help="of a .csv: write the guesses to dataset/NAME.yaml, to edit"
    )


def answer(chosen: argparse.Namespace) -> None:
    """Print the topics of a bag, or what a .csv's columns may be; then the facts of the recording made of it."""
    from jerkbench.errors import JerkbenchError, RecordingError, unknown
    from jerkbench.io.ros.options import BagOptions

    if chosen.figure is not None and chosen.figure.suffix not in FIGURES:
        raise JerkbenchError(unknown("suffix of a figure", chosen.figure.suffix, FIGURES))
    if guesses_columns(chosen):
        print_guesses(chosen, _describe)
        return
    dataset = dataset_of(chosen.source, chosen.dataset, chosen.set)
    if not isinstance(dataset, BagOptions):
        _describe(dataset.load(chosen.seed), dataset, chosen.figure)
        return
    _print_topics(dataset.path)
    try:
        recording = dataset.load(chosen.seed)
    except RecordingError as error:  # the bag can be read: what it lacks is an answer
        print(f"\nNo recording can be made of it as it is: {error}")
    else:
        print()
        _describe(recording, dataset, chosen.figure)


def _describe(recording: "Recording", dataset: "Dataset", figure: Path | None) -> None:
    from jerkbench.inspection.facts import facts_text

    print(facts_text(recording))
    shifts = {name: getattr(dataset, name, None) for name in SHIFTS}
    shifts_text = [
        f"{name}={value}" for name, value in shifts.items() if (any(value) if isinstance(value, tuple) else value)
    ]
    if shifts_text:
        print(f"Times are shifted already by {', '.join(shifts_text)}: what is left of the lags is above.")
    if figure is not None:
        from jerkbench.inspection.overview import overview_figure
        from jerkbench.report.plots.figures import save_figure

        save_figure(overview_figure(recording), figure)
        print(f"Figure: {figure}")


def _print_topics(path: Path) -> None:
    from jerkbench.io.ros.bag import open_bag
    from jerkbench.io.ros.survey import survey

    with open_bag(path) as bag:
        for line in survey(bag):
            print(line)
