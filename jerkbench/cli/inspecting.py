"""The verbs that judge a recording: inspect, receiver and smooth."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.cli.arguments import argument, output, require_new, verb
from jerkbench.cli.recordings import SOURCE_WORDS, dataset_of
from jerkbench.errors import JerkbenchError, RecordingError, require_known, unknown

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from jerkbench.contracts import Dataset
    from jerkbench.inspection.guessing import Draft
    from jerkbench.recording import Recording

TABULAR = (".csv", ".pos")


def _guesses_columns(chosen: argparse.Namespace) -> bool:
    """Whether the sources are tables whose columns nobody named.

    Raises:
        JerkbenchError: several sources or a preset were asked for, of something else.
    """
    from jerkbench.io.tracks import track_reader

    paths = [Path(source).expanduser() for source in chosen.source]
    tables = [path for path in paths if path.is_file() and (path.suffix.lower() in TABULAR or track_reader(path))]
    guesses = chosen.dataset is None and tables == paths
    if not guesses and (getattr(chosen, "preset", None) is not None or len(paths) > 1):
        which = next((path for path in paths if path not in tables), paths[0])
        raise JerkbenchError(
            "--preset, and several files, are for tables (.csv, .pos, NMEA, GPX, gpsd's JSON) whose columns are"
            f" guessed, and {which} is none."
        )
    return guesses


def _print_guesses(chosen: argparse.Namespace) -> None:
    """Print the guesses, write the preset, and describe the recording that they make.

    Raises:
        RecordingError: the columns cannot be told by their names.
        JerkbenchError: the preset is there already.
    """
    from jerkbench.datasets.table import Tables
    from jerkbench.inspection.guessing import guess_tables

    draft = guess_tables(*(Path(source).expanduser() for source in chosen.source))
    for guess in draft.guesses.values():
        print(guess)
    if draft.unused:
        print(f"not used: {', '.join(draft.unused)}; columns of an attitude or of the truth go to reference_...")
    unsure = [guess.parameter for guess in draft.guesses.values() if guess.grade == "unsure"]
    print(f"Say yourself: {', '.join(unsure)}." if unsure else "Nothing is unsure.")
    print()
    _describe_if_whole(draft.load, Tables(**draft.settings), chosen.figure)
    if chosen.preset is not None:
        _write_preset(draft, chosen.preset)


def _write_preset(draft: "Draft", preset: Path) -> None:
    from jerkbench.files import write_text
    from jerkbench.inspection.guessing import preset_path, preset_text

    path = preset_path(preset)
    require_new(path)
    write_text(path, preset_text(draft, path.stem))
    print(f"Preset: {path}. Correct it, then: jerkbench run --config-dir {path.parents[1]} dataset={path.stem}")


_SHIFT_PARAMETERS = ("imu_shift_s", "position_latency_s", "velocity_latency_s", "position_shift_s", "velocity_shift_s")
"""Parameters of data sets that move stamps to the time when the values were true."""

_FIGURES = (".pdf", ".png", ".svg")


SEVERAL_SOURCES = (
    argument(
        "source",
        nargs="+",
        metavar="SOURCE",
        help="a file or folder, a data set or its preset; or the tables of one log: IMU, fixes, reference",
    ),
    *SOURCE_WORDS[1:],
)


@verb(
    *SEVERAL_SOURCES,
    argument("--figure", type=Path, metavar="FILE", help="draw an overview of the recording too (.png, .pdf)"),
    argument(
        "--preset", type=output, metavar="NAME.yaml", help="of tables: write the guesses to dataset/NAME.yaml, to edit"
    ),
)
def inspect_verb(chosen: argparse.Namespace) -> None:
    """Print what a recording is made of, and what is wrong with it.

    Of a bag it also lists the topics; of tables it guesses the columns.

      jerkbench data inspect drive.bag --figure overview.png
      jerkbench data inspect field --set duration_s=30 --seed 1
    """
    from jerkbench.io.bag_dataset import BagOptions

    _require_figure(chosen.figure)
    if _guesses_columns(chosen):
        _print_guesses(chosen)
        return
    dataset = dataset_of(chosen.source[0], chosen.dataset, chosen.set)
    if not isinstance(dataset, BagOptions):
        _describe(dataset.load(chosen.seed), dataset, chosen.figure)
        return
    from jerkbench.io.bag import open_bag
    from jerkbench.io.bag_survey import survey

    with open_bag(dataset.path) as bag:
        print(*survey(bag), "", sep="\n")
    _describe_if_whole(lambda: dataset.load(chosen.seed), dataset, chosen.figure)


def _describe_if_whole(load: "Callable[[], Recording]", dataset: "Dataset", figure: Path | None) -> None:
    try:
        recording = load()
    except RecordingError as error:  # the source can be read: what it lacks is an answer
        print(f"No recording can be made of it as it is: {error}")
    else:
        _describe(recording, dataset, figure)


def _describe(recording: "Recording", dataset: "Dataset", figure: Path | None) -> None:
    import numpy as np

    from jerkbench.inspection.facts import facts_text, overview_figure

    print(facts_text(recording))
    shifts = {name: getattr(dataset, name, None) for name in _SHIFT_PARAMETERS}
    if shifted := [f"{name}={value}" for name, value in shifts.items() if np.any(value)]:
        print(f"Times are shifted already by {', '.join(shifted)}: what is left of the lags is above.")
    if figure is not None:
        _save(overview_figure(recording), figure)


def _save(figure: "Figure", path: Path) -> None:
    from jerkbench.report.plots.style import save_figure

    save_figure(figure, path)
    print(f"Figure: {path}")


@verb(
    *SOURCE_WORDS, argument("--figure", type=Path, metavar="FILE", help="draw the errors and their memory (.png, .pdf)")
)
def receiver_verb(chosen: argparse.Namespace) -> None:
    """Measure how far off a receiver's covariance is, and say what to put into a filter.

      jerkbench data receiver drive.bag --figure receiver.png
      jerkbench data receiver field --set duration_s=60 --seed 1

    Raises:
        JerkbenchError: there are too few fixes, or no such kind of figure.
    """
    from jerkbench.inspection.receiver import HEADER, advice, receiver_errors, receiver_figure, table_rows
    from jerkbench.report.terminal import print_grid

    _require_figure(chosen.figure)
    recording = dataset_of(chosen.source, chosen.dataset, chosen.set).load(chosen.seed)
    errors = receiver_errors(recording)
    if errors is None:
        raise JerkbenchError(f"{recording.name} has too few fixes to say anything about their covariance.")
    compared = f"compared with {errors.source}" if errors.source else "compared with each other"
    title = f"{recording.name}: fixes each {errors.step_s:.3g} s, {compared}"
    print_grid(title, HEADER, list(table_rows(errors)), list(advice(errors)))
    if chosen.figure is not None:
        _save(receiver_figure(recording, errors), chosen.figure)


def _require_figure(path: Path | None) -> None:
    if path is not None and path.suffix not in _FIGURES:
        raise JerkbenchError(unknown("suffix of a figure", path.suffix, _FIGURES))


@verb(
    *SEVERAL_SOURCES,
    argument(
        "--to", default="gpx", metavar="FILE", help="the track: a file that ends in .gpx, .kml, .tum, or an ending"
    ),
    argument("--figure", type=Path, metavar="FILE", help="draw the fixes and the track (.png, .pdf)"),
)
def smooth_verb(chosen: argparse.Namespace) -> None:
    """Write a better track from fixes alone: a smoother, tuned on the log itself.

      jerkbench smooth ride.gpx --to smooth.gpx --figure smooth.png
      jerkbench smooth field --set duration_s=60 --to kml

    Raises:
        JerkbenchError: there are too few fixes, the file is there, or its ending is unknown.
    """
    from jerkbench.inspection.guessing import guess_tables
    from jerkbench.inspection.smoothing import smooth_fixes, track_figure, track_lines
    from jerkbench.io.writing import TRAJECTORIES

    _require_figure(chosen.figure)
    suffix = f".{chosen.to.rpartition('.')[2]}"
    require_known("ending of a track", suffix, TRAJECTORIES, JerkbenchError)
    if _guesses_columns(chosen):
        recording = guess_tables(*(Path(source).expanduser() for source in chosen.source)).load()
    else:
        recording = dataset_of(chosen.source[0], chosen.dataset, chosen.set).load(chosen.seed)
    target = Path(chosen.to if "." in chosen.to else f"{Path(chosen.source[0]).stem}_smooth{suffix}")
    require_new(target)
    track = smooth_fixes(recording)
    TRAJECTORIES[suffix](track.recording, target, "reference")
    for line in track_lines(track):
        print(line)
    print(f"Track: {target}")
    if chosen.figure is not None:
        _save(track_figure(track), chosen.figure)
