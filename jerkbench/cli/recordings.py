"""The commands for recordings: the group `data`, and `smooth`."""

import argparse
import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from jerkbench.cli.arguments import argument, command, count, flag, require_new
from jerkbench.contracts import Dataset
from jerkbench.errors import JerkbenchError, PluginError, RecordingError, require_known

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from jerkbench.recording import Recording

SUFFIXES = {".pos": "rtklib", ".bag": "rosbag", ".db3": "rosbag", ".mcap": "rosbag", ".active": "rosbag"}
"""The data set that reads a file with a suffix, or a folder with files of this suffix. After a power loss, a ROS 1 bag
has the suffix .bag.active."""

FOLDER_PATTERNS = {
    "*.hdf5": "broad",
    "processed_log": "comma2k19",
    "oxts": "kitti",
    "imu0": "euroc",
    "ms25.csv": "nclt",
    "RTK1105.csv": "tokyo_1105",
    "goGPS_WLS.csv": "pixel4",
    "GPSRaw.dat": "beijing_car",
}
"""The data set or preset that reads a folder, by the pattern of a file in the folder."""

SOURCE_ARGUMENTS = (
    argument("source", help="a file or folder, or the name of a data set or its preset"),
    argument("--dataset", metavar="NAME", help="data set that reads the file (default: from its suffix)"),
    argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="parameters of the data set"),
    argument("--seed", type=count, default=0, help="seed of a simulated recording (default: 0)"),
)
"""The arguments that select a recording."""

SEVERAL_SOURCES = (
    argument("source", nargs="+", metavar="SOURCE", help="a file, a folder, a data set, or the tables of one log"),
    *SOURCE_ARGUMENTS[1:],
)

TABULAR = (".csv", ".pos")

_FIGURES = (".pdf", ".png", ".svg")

_SHIFT_PARAMETERS = ("imu_shift_s", "position_latency_s", "velocity_latency_s", "position_shift_s", "velocity_shift_s")
"""Parameters of data sets that shift time stamps to the times at which the values are valid."""


def dataset_of(source: str, name: str | None, settings: Sequence[str]) -> Dataset:
    """Return the data set that reads ``source``.

    Args:
        source: An existing file or folder, or the name of a data set or preset.
        name: The data set that reads the file. If ``name`` is None, the suffix of the file selects the data set.
        settings: Parameters of the data set, each in the form ``key=value``.

    Raises:
        PluginError: The source does not exist, no data set plugin can read the file, or a parameter is invalid.
    """
    from jerkbench import plugins
    from jerkbench.jobs.names import choose

    parameters = _parameters(settings)
    path = Path(source).expanduser()
    if not path.exists() and (name is not None or path.name != source or path.suffix):
        raise PluginError(f"The file or folder {source} does not exist; correct the path.")
    dataset = (name or _by_content(path)) if path.exists() else source
    plain = choose("dataset", {**parameters, "name": dataset}).plain
    if path.exists():  # the first parameter of a data set that reads files is the file or folder
        plain = {**plain, dataclasses.fields(plugins.get("dataset", plain["name"]))[0].name: str(path)}
    return cast("Dataset", plugins.create("dataset", plain))


def _parameters(settings: Sequence[str]) -> dict[str, Any]:
    """Parse parameters of a data set, written as arguments of `jerkbench run`, with or without ``dataset.``."""
    from jerkbench.hydra_app.overrides import parsed_override

    if wrong := [setting for setting in settings if "=" not in setting]:
        raise PluginError(f"'{wrong[0]}' is not a parameter; give --set KEY=VALUE.")
    overrides = [parsed_override(_quoted_symbol(setting.removeprefix("dataset."))) for setting in settings]
    return {override.key_or_group: override.value() for override in overrides}


def _quoted_symbol(setting: str) -> str:
    """Quote a value that is a single symbol, such as a separator, because many symbols have a meaning for Hydra."""
    key, _, value = setting.partition("=")
    return f"{key}={json.dumps(value)}" if len(value) == 1 and not value.isalnum() else setting


def _by_content(path: Path) -> str:
    """Return the name of the data set that reads a file or folder, selected by its suffix or by its content."""
    from jerkbench import plugins

    suffixes = [path.suffix] if path.is_file() else sorted({inside.suffix for inside in path.iterdir()})
    fitting = [SUFFIXES[suffix] for suffix in suffixes if suffix in SUFFIXES]
    if path.is_dir():
        fitting += [name for pattern, name in FOLDER_PATTERNS.items() if any(path.glob(pattern))]
    fitting = list(dict.fromkeys(fitting))
    if len(fitting) == 1:
        return fitting[0]
    why = f"can be read by {' or by '.join(fitting)}" if fitting else "has no suffix and no files of a known data set"
    first = {name: dataclasses.fields(plugins.get("dataset", name))[0].name for name in plugins.names("dataset")}
    readers = ", ".join(name for name, parameter in first.items() if parameter in ("file", "folder"))
    raise PluginError(f"{path} {why}; select the data set with --dataset NAME, one of {readers}.")


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
        why = "is not such a table" if other.exists() or not other.suffix else "does not exist; correct the path"
        raise JerkbenchError(f"--preset and several files need tables such as CSV, and no --dataset; {other} {why}.")
    return []


def _print_guesses(arguments: argparse.Namespace, tables: list[Path]) -> None:
    from jerkbench.datasets.table import Tables
    from jerkbench.files import write_text
    from jerkbench.inspection.guessing import guess_tables, preset_path, preset_text

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
        path = preset_path(arguments.preset)
        require_new(path)
        write_text(path, preset_text(draft, path.stem))
        using = f"jerkbench run --config-dir {path.parents[1]} dataset={path.stem}"
        print(f"Preset: {path}. Check the file, then run: {using}")


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
    if path is not None:
        require_known("suffix of a figure", path.suffix, _FIGURES, JerkbenchError)


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


TARGETS = {
    ".bag": "ROS 1 bag",
    ".db3": "ROS 2 bag, sqlite3",
    ".mcap": "ROS 2 bag, mcap",
    ".csv": "table",
    ".parquet": "table",
    ".tum": "trajectory as text",
    ".gpx": "trajectory on the Earth",
}


@command(
    *SOURCE_ARGUMENTS,
    argument("target", type=Path, help="the file to write; its suffix selects the format"),
    argument("--coordinates", choices=("enu", "geodetic", "ned"), default="enu", help="coordinates in a table"),
    argument("--stream", choices=("reference", "position"), help="the trajectory to write (default: reference)"),
)
def convert_command(arguments: argparse.Namespace) -> None:
    """Write a recording as a ROS bag, a table or a trajectory.

    Suffixes of TARGET: .bag (ROS 1 bag), .db3 (ROS 2 bag, sqlite3), .mcap (ROS 2 bag, mcap), .csv (table), .parquet
    (table), .tum (trajectory as text), .gpx (trajectory on the Earth)

      jerkbench data convert field drive.bag --set duration_s=30
      jerkbench data convert drive.bag drive.csv --coordinates ned
    """
    target: Path = arguments.target
    require_known("suffix of a target", target.suffix, TARGETS, JerkbenchError)
    require_new(target)
    recording = dataset_of(arguments.source, arguments.dataset, arguments.set).load(arguments.seed)
    left_out: list[str] = []
    if target.suffix in (".csv", ".parquet"):
        from jerkbench.io.writing import write_table

        write_table(recording, target, arguments.coordinates)
    elif target.suffix in (".tum", ".gpx"):
        from jerkbench.io.writing import TRAJECTORIES

        TRAJECTORIES[target.suffix](recording, target, arguments.stream)
    else:
        from jerkbench.io.bag_writing import write_bag

        left_out = write_bag(recording, target)
    print(f"{target}: {recording.name} as {TARGETS[target.suffix]}")
    for note in left_out:
        print(note)


EXPORT_FORMATS = "csv (default), parquet, bag, mcap; give this option after KEY=VALUE"


@command(
    argument("folder", type=Path, help="the folder to write; it must not exist"),
    argument("overrides", nargs="*", metavar="KEY=VALUE", help="arguments of `jerkbench run`"),
    argument("--format", nargs="+", default=["csv"], metavar="FORMAT", help=EXPORT_FORMATS),
    flag("--without-reference", help="do not write reference.csv"),
)
def data_export_command(arguments: argparse.Namespace) -> None:
    """Write disturbed recordings for other programs, one folder for each seed.

    KEY=VALUE are arguments of `jerkbench run`: dataset, disturbance, attitude, their parameters, seeds, first_seed.

      jerkbench data export drive dataset=field disturbance=gnss_outage seeds=5
      jerkbench data export tools dataset=field seeds=1 --format csv mcap

    FOLDER/SEED/recording.csv has a row for each stamp of any stream, and recording.json describes the columns. The
    reference, which a method must not use, is FOLDER/SEED/reference.csv.

    Raises:
        JerkbenchError: The folder exists, a format or an argument is unknown, or a format needs a package.
    """
    from jerkbench.hydra_app.composition import composed
    from jerkbench.io.writing import FORMATS, write_recording, write_reference
    from jerkbench.jobs.rows import shared_inputs

    folder: Path = arguments.folder
    for name in arguments.format:
        require_known("format", name, FORMATS, JerkbenchError)
    require_new(folder)
    job, inputs = composed(arguments.overrides).job(), shared_inputs()
    for draw in job.draws:
        recording, target = inputs.recording(job.scenario, draw), folder / str(draw)
        attitude = inputs.attitude(recording, job.scenario.attitude)
        source = {"made_of": {"seed": draw, **job.scenario.plain}}
        for path in write_recording(recording, attitude, target, arguments.format, source):
            print(path)
        if not arguments.without_reference:
            write_reference(recording, target / "reference.csv")
            print(target / "reference.csv")


@command(argument("name", nargs="?", help="the recording (default: list all recordings and their folders)"))
def fetch_command(arguments: argparse.Namespace) -> None:
    """Download a public recording, verify its hashes, and store it.

      jerkbench data fetch
      jerkbench data fetch broad

    Raises:
        RecordingError: The recording is unknown, or it cannot be downloaded.
    """
    from jerkbench.io.fetching import fetch, public_recording, public_recordings
    from jerkbench.io.files import fetched_folder

    if arguments.name is None:
        for public in public_recordings().values():
            folder = fetched_folder(public.name)
            print(f"{public.name}: {public.title} ({public.licence}); {folder if folder.is_dir() else 'not fetched'}")
        return
    recording, folder = public_recording(arguments.name), fetched_folder(arguments.name)
    print(f"{recording.name}: {recording.title}; licence {recording.licence}, {len(recording.files)} files")
    fetch(recording, folder, print)
    print(f"{recording.name} is in {folder}")


@command(
    *SOURCE_ARGUMENTS,
    argument("target", type=Path, help="the file to write, .parquet"),
    argument("--offset", choices=("remove", "keep"), default="remove", help="median of the errors (default: remove)"),
    argument("--licence", default="", help="licence of the data, stored in the file"),
    argument("--origin", default="", help="source of the data, stored in the file"),
)
def trace_command(arguments: argparse.Namespace) -> None:
    """Write the errors of the fixes of a recording, for use in other recordings.

    The errors are relative to the reference. `jerkbench run disturbance=replayed_gnss` replays the errors, with
    disturbance.replayed_gnss.trace=TARGET.

      jerkbench data trace field errors.parquet --set duration_s=30
      jerkbench data trace field biased.parquet --set duration_s=30 --offset keep
    """
    from jerkbench.simulation.traces import SUFFIX, read_trace, trace_of, trace_text, write_trace

    target: Path = arguments.target
    require_known("suffix of a trace", target.suffix, [SUFFIX], JerkbenchError)
    require_new(target)
    recording = dataset_of(arguments.source, arguments.dataset, arguments.set).load(arguments.seed)
    centred = arguments.offset == "remove"
    write_trace(trace_of(recording, centred=centred, licence=arguments.licence, origin=arguments.origin), target)
    print(f"{target}: {trace_text(read_trace(target))}")


@command(flag("--clear", help="delete the cache; its contents can be computed again"))
def cache_command(arguments: argparse.Namespace) -> None:
    """Show the contents of the user's cache, or clear it.

    The cache does not contain fetched recordings, because they cannot be computed again.

      jerkbench data cache
      jerkbench data cache --clear
    """
    from jerkbench.compilation.compiled import COMPILED
    from jerkbench.files import cache_folder
    from jerkbench.io import bag
    from jerkbench.jobs.rows import SIMULATED, SIMULATED_PATTERN

    for title, name, pattern in (
        ("compiled filters and adaptations", COMPILED, "**/*"),
        ("messages of bags", bag.BAGS, bag.PATTERN),
        ("simulated recordings", SIMULATED, SIMULATED_PATTERN),
    ):
        folder = cache_folder(name)
        files = [path for path in sorted(folder.glob(pattern)) if path.is_file()]
        megabytes = sum(file.stat().st_size for file in files) / 1e6
        if arguments.clear:
            for file in files:
                file.unlink(missing_ok=True)
        done = ", deleted" if arguments.clear and files else ""
        print(f"{title}: {len(files)} files, {megabytes:.1f} MB in {folder}{done}")
