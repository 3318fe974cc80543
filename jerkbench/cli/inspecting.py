"""The commands that analyse a recording: `data inspect`, `data receiver` and `smooth`."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.cli.arguments import argument, command, require_new
from jerkbench.cli.recordings import SOURCE_ARGUMENTS, dataset_of
from jerkbench.errors import JerkbenchError, RecordingError, require_known, unknown

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from jerkbench.contracts import Dataset
    from jerkbench.inspection.guessing import Draft
    from jerkbench.recording import Recording

TABULAR = (".csv", ".pos")


def _tables(arguments: argparse.Namespace) -> list[Path]:
    """Return the paths of the sources if all sources are tables whose columns must be guessed, or an empty list.

    Raises:
        JerkbenchError: Several sources or a preset are given, but not all sources are tables.
    """
    from jerkbench.io.tracks import track_reader

    paths = [Path(source).expanduser() for source in arguments.source]
    tables = [path for path in paths if path.is_file() and (path.suffix.lower() in TABULAR or track_reader(path))]
    if arguments.dataset is None and tables == paths:
        return paths
    if getattr(arguments, "preset", None) is not None or len(paths) > 1:
        other = next((path for path in paths if path not in tables), paths[0])
        needed = "tables (.csv, .pos, NMEA, GPX) without --dataset"
        raise JerkbenchError(f"--preset and several files need {needed}; {other} is not such a table.")
    return []


def _print_guesses(arguments: argparse.Namespace, tables: list[Path]) -> None:

    from jerkbench.datasets.table import Tables
    from jerkbench.inspection.guessing import guess_tables

    draft = guess_tables(*tables)
    for guess in draft.guesses.values():
        print(guess)
    if draft.unused:
        print(f"Unused columns: {', '.join(draft.unused)}. Set reference_... for columns with attitudes or references.")
    unsure = [guess.parameter for guess in draft.guesses.values() if guess.grade == "unsure"]
    print(f"Uncertain, please check: {', '.join(unsure)}." if unsure else "No parameter is uncertain.")
    print()
    _describe_if_readable(draft.load, Tables(**draft.settings), arguments.figure)
    if arguments.preset is not None:
        _write_preset(draft, arguments.preset)


def _write_preset(draft: "Draft", preset: Path) -> None:
    from jerkbench.files import write_text
    from jerkbench.inspection.guessing import preset_path, preset_text

    path = preset_path(preset)
    require_new(path)
    write_text(path, preset_text(draft, path.stem))
    print(f"Preset: {path}. Check the file, then run: jerkbench run --config-dir {path.parents[1]} dataset={path.stem}")


_SHIFT_PARAMETERS = ("imu_shift_s", "position_latency_s", "velocity_latency_s", "position_shift_s", "velocity_shift_s")
"""Parameters of data sets that shift time stamps to the times at which the values are valid."""

_FIGURES = (".pdf", ".png", ".svg")


_SOURCES = argument(
    "source", nargs="+", metavar="SOURCE", help="a file, a folder, a data set, or the tables of one log"
)
SEVERAL_SOURCES = (_SOURCES, *SOURCE_ARGUMENTS[1:])


@command(
    *SEVERAL_SOURCES,
    argument("--figure", type=Path, metavar="FILE", help="draw an overview of the recording (.png, .pdf)"),
    argument("--preset", type=Path, metavar="NAME.yaml", help="for tables: write the guesses to dataset/NAME.yaml"),
)
def inspect_command(arguments: argparse.Namespace) -> None:
    """Print the contents of a recording, and the mistakes found in it.

    For a bag, the command lists the topics. For tables, the command guesses the meanings of the columns.

      jerkbench data inspect drive.bag --figure overview.png
      jerkbench data inspect field --set duration_s=30 --seed 1
    """
    from jerkbench.io.bag_dataset import BagOptions

    _require_figure(arguments.figure)
    if tables := _tables(arguments):
        _print_guesses(arguments, tables)
        return
    dataset = dataset_of(arguments.source[0], arguments.dataset, arguments.set)
    if not isinstance(dataset, BagOptions):
        _describe(dataset.load(arguments.seed), dataset, arguments.figure)
        return
    from jerkbench.io.bag import open_bag, survey

    with open_bag(dataset.path) as bag:
        print(*survey(bag), "", sep="\n")
    _describe_if_readable(lambda: dataset.load(arguments.seed), dataset, arguments.figure)


def _describe_if_readable(load: "Callable[[], Recording]", dataset: "Dataset", figure: Path | None) -> None:
    try:
        recording = load()
    except RecordingError as error:  # the source was readable, so a missing stream is a finding and not an error
        print(f"The source cannot be used as a recording: {error}")
    else:
        _describe(recording, dataset, figure)


def _describe(recording: "Recording", dataset: "Dataset", figure: Path | None) -> None:
    import numpy as np

    from jerkbench.inspection.facts import facts_text, overview_figure

    print(facts_text(recording))
    shifts = {name: getattr(dataset, name, None) for name in _SHIFT_PARAMETERS}
    if shifted := [f"{name}={value}" for name, value in shifts.items() if np.any(value)]:
        print(f"The times are already shifted by {', '.join(shifted)}; the lags above are the remaining lags.")
    if figure is not None:
        _save(overview_figure(recording), figure)


def _save(figure: "Figure", path: Path) -> None:
    from jerkbench.report.plots.style import save_figure

    save_figure(figure, path)
    print(f"Figure: {path}")


@command(*SOURCE_ARGUMENTS)
def receiver_command(arguments: argparse.Namespace) -> None:
    """Compare the reported covariance of a receiver with its errors, and recommend filter settings.

      jerkbench data receiver drive.bag
      jerkbench data receiver field --set duration_s=60 --seed 1

    Raises:
        JerkbenchError: There are too few fixes.
    """
    from jerkbench.inspection.receiver import HEADER, advice, receiver_errors, table_rows
    from jerkbench.report.terminal import print_grid

    recording = dataset_of(arguments.source, arguments.dataset, arguments.set).load(arguments.seed)
    errors = receiver_errors(recording)
    if errors is None:
        raise JerkbenchError(f"{recording.name} has too few fixes to estimate their covariance.")
    compared = f"compared with {errors.source}" if errors.source else "compared with each other"
    title = f"{recording.name}: a fix every {errors.step_s:.3g} s, {compared}"
    print_grid(title, HEADER, list(table_rows(errors)), list(advice(errors)))


def _require_figure(path: Path | None) -> None:
    if path is not None and path.suffix not in _FIGURES:
        raise JerkbenchError(unknown("suffix of a figure", path.suffix, _FIGURES))


@command(
    *SEVERAL_SOURCES,
    argument("--to", default="gpx", metavar="FILE", help="the track: a file (.gpx, .tum), or its suffix"),
    argument("--figure", type=Path, metavar="FILE", help="draw the fixes and the track (.png, .pdf)"),
)
def smooth_command(arguments: argparse.Namespace) -> None:
    """Smooth the fixes of a log, without an IMU. The smoother is tuned on the same log.

      jerkbench smooth ride.gpx --to smooth.gpx --figure smooth.png
      jerkbench smooth field --set duration_s=60 --to tum

    Raises:
        JerkbenchError: There are too few fixes, the file already exists, or its suffix is unknown.
    """
    from jerkbench.inspection.facts import overview_figure
    from jerkbench.inspection.guessing import guess_tables
    from jerkbench.inspection.smoothing import smooth_fixes, track_lines
    from jerkbench.io.writing import TRAJECTORIES

    _require_figure(arguments.figure)
    suffix = f".{arguments.to.rpartition('.')[2]}"
    require_known("suffix of a track", suffix, TRAJECTORIES, JerkbenchError)
    if tables := _tables(arguments):
        recording = guess_tables(*tables).load()
    else:
        recording = dataset_of(arguments.source[0], arguments.dataset, arguments.set).load(arguments.seed)
    target = Path(arguments.to if "." in arguments.to else f"{Path(arguments.source[0]).stem}_smooth{suffix}")
    require_new(target)
    track = smooth_fixes(recording)
    TRAJECTORIES[suffix](track.recording, target, "reference")
    for line in track_lines(track):
        print(line)
    print(f"Track: {target}")
    if arguments.figure is not None:
        _save(overview_figure(track.recording, "smoothed"), arguments.figure)
