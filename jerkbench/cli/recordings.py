"""The verbs of the group `data` that write, fetch and delete recordings; the recording behind the words of a person."""

import argparse
import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from jerkbench.cli.arguments import argument, count, output, require_new, verb
from jerkbench.contracts import Dataset
from jerkbench.errors import JerkbenchError, PluginError, require_known

# The recording behind the words of a person: a file or folder, or the name of a data set.

SUFFIXES = {".pos": "rtklib", ".bag": "rosbag", ".db3": "rosbag", ".mcap": "rosbag", ".active": "rosbag"}
"""The data set that reads files of a suffix, or a folder of them; a power loss leaves a .bag.active."""

INSIDE = {
    "*.hdf5": "broad",
    "processed_log": "comma2k19",
    "oxts": "kitti",
    "imu0": "euroc",
    "ms25.csv": "nclt",
    "RTK1105.csv": "tokyo_1105",
    "goGPS_WLS.csv": "pixel4",
    "GPSRaw.dat": "beijing_car",
    "GroundTruthAGL.csv": "zurich_mav",
}
"""Files of a folder that show its data set, or a preset of one."""


SOURCE_WORDS = (
    argument("source", help="a file or folder, or the name of a data set or its preset"),
    argument("--dataset", metavar="NAME", help="the data set that reads the file (default: by its suffix)"),
    argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="parameters of the data set"),
    argument("--seed", type=count, default=0, help="of a simulated recording (default 0)"),
)
"""The words that name a recording."""


def dataset_of(source: str, name: str | None, words: Sequence[str]) -> Dataset:
    """Return the data set that reads ``source``.

    Args:
        source: an existing file or folder, or the name of a data set or preset.
        name: the data set that reads the file; None: by its suffix.
        words: parameters, ``key=value`` each.

    Raises:
        PluginError: nothing of that name, no data set for the file, or a parameter that does not fit.
    """
    from jerkbench import plugins
    from jerkbench.jobs.names import choose

    parameters = _parameters(words)
    path = Path(source).expanduser()
    if not path.exists() and (name is not None or path.name != source or path.suffix):
        raise PluginError(f"There is no file or folder {source}; correct the path.")
    called = (name or _by_content(path)) if path.exists() else source
    plain = choose("dataset", {**parameters, "name": called}).plain
    if path.exists():  # its first parameter is the file or folder that it reads
        plain = {**plain, dataclasses.fields(plugins.get("dataset", plain["name"]))[0].name: str(path)}
    return cast("Dataset", plugins.create("dataset", plain))


def _parameters(words: Sequence[str]) -> dict[str, Any]:
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    if wrong := [word for word in words if "=" not in word]:
        raise PluginError(f"'{wrong[0]}' is no parameter; give KEY=VALUE.")
    try:
        parsed = OmegaConf.to_container(OmegaConf.from_dotlist([_text_if_a_sign(word) for word in words]))
    except (OmegaConfBaseException, YAMLError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise PluginError(f"{' '.join(words)} cannot be read as YAML: {reason}. Put text into quotes.") from error
    return cast("dict[str, Any]", parsed)


def _text_if_a_sign(word: str) -> str:
    """Return the word with its value in quotes if that is a single sign, many of which mean something in YAML."""
    key, _, value = word.partition("=")
    return f"{key}={json.dumps(value)}" if len(value) == 1 and not value.isalnum() else word


def _by_content(path: Path) -> str:
    """The data set that the suffix of a file names, or what a folder holds."""
    from jerkbench import plugins

    suffixes = [path.suffix] if path.is_file() else sorted({inside.suffix for inside in path.iterdir()})
    fitting = [SUFFIXES[suffix] for suffix in suffixes if suffix in SUFFIXES]
    if path.is_dir():
        fitting += [name for pattern, name in INSIDE.items() if any(path.glob(pattern))]
    fitting = list(dict.fromkeys(fitting))
    if len(fitting) == 1:
        return fitting[0]
    nothing = "has no suffix, and holds nothing, that tells its data set"
    why = f"could be of {' or '.join(fitting)}" if fitting else nothing
    first = {name: dataclasses.fields(plugins.get("dataset", name))[0].name for name in plugins.names("dataset")}
    readers = ", ".join(name for name, parameter in first.items() if parameter in ("file", "folder"))
    raise PluginError(f"{path} {why}; give --dataset NAME ({readers}).")


TARGETS = {
    ".bag": "ROS 1 bag",
    ".db3": "ROS 2 bag, sqlite3",
    ".mcap": "ROS 2 bag, mcap",
    ".csv": "table",
    ".parquet": "table",
    ".tum": "trajectory as text",
    ".kml": "trajectory on the Earth",
    ".gpx": "trajectory on the Earth with times",
}


@verb(
    *SOURCE_WORDS,
    argument("target", type=Path, help="the file to write; its suffix says what"),
    argument("--coordinates", choices=("enu", "geodetic", "ned"), default="enu", help="of a table's positions"),
    argument("--stream", choices=("reference", "position"), help="which trajectory (default: the reference's)"),
)
def convert_verb(chosen: argparse.Namespace) -> None:
    """Write a recording as a ROS bag, a table or a trajectory.

    TARGET ends in: .bag (ROS 1 bag), .db3 (ROS 2 bag, sqlite3), .mcap (ROS 2 bag, mcap), .csv (table), .parquet
    (table), .tum (trajectory as text), .kml (trajectory on the Earth), .gpx (trajectory on the Earth with times)

      jerkbench data convert field drive.bag --set duration_s=30
      jerkbench data convert drive.bag drive.csv --coordinates ned
    """
    target: Path = chosen.target
    require_known("suffix of a target", target.suffix, TARGETS, JerkbenchError)
    require_new(target)
    recording = dataset_of(chosen.source, chosen.dataset, chosen.set).load(chosen.seed)
    left_out: list[str] = []
    if target.suffix in (".csv", ".parquet"):
        from jerkbench.io.writing import write_table

        write_table(recording, target, chosen.coordinates)
    elif target.suffix in (".tum", ".kml", ".gpx"):
        from jerkbench.io.writing import TRAJECTORIES

        TRAJECTORIES[target.suffix](recording, target, chosen.stream)
    else:
        from jerkbench.io.bag_writing import write_bag

        left_out = write_bag(recording, target)
    print(f"{target}: {recording.name} as {TARGETS[target.suffix]}")
    for sentence in left_out:
        print(sentence)


@verb(
    argument("folder", type=output, help="the folder to write; it must not be there yet"),
    argument("words", nargs="*", metavar="KEY=VALUE", help="what `jerkbench run` takes"),
    argument(
        "--format",
        nargs="+",
        default=["csv"],
        metavar="FORMAT",
        help="csv (default), parquet, bag, mcap, kf_gins, pyins; give it after KEY=VALUE",
    ),
    argument("--without-reference", action="store_true", help="leave reference.csv out"),
)
def data_export_verb(chosen: argparse.Namespace) -> None:
    """Write disturbed recordings for programs of your own, one folder a seed.

    KEY=VALUE are those of `jerkbench run`: dataset, disturbance, attitude, their parameters, seeds, first_seed.

      jerkbench data export drive dataset=field disturbance=gnss_outage seeds=5
      jerkbench data export tools dataset=field seeds=1 --format csv kf_gins pyins mcap

    FOLDER/SEED/recording.csv has a row for each stamp of any stream; recording.json says what its columns are. What a
    method does not get, the reference, is FOLDER/SEED/reference.csv.

    Raises:
        JerkbenchError: the folder is there, a format or a word is unknown, or a format lacks something.
    """
    from jerkbench.hydra_app.composition import composed
    from jerkbench.io.recording_folder import FORMATS, write_recording, write_reference
    from jerkbench.jobs.inputs import shared_inputs

    folder: Path = chosen.folder
    for name in chosen.format:
        require_known("format", name, FORMATS, JerkbenchError)
    require_new(folder)
    job, inputs = composed(chosen.words).job(), shared_inputs()
    for draw in job.draws:
        recording, own = inputs.recording(job.scenario, draw), folder / str(draw)
        attitude = inputs.attitude(recording, job.scenario.attitude)
        source = {"made_of": {"seed": draw, **job.scenario.plain}}
        for path in write_recording(recording, attitude, own, chosen.format, source):
            print(path)
        if not chosen.without_reference:
            write_reference(recording, own / "reference.csv")
            print(own / "reference.csv")


@verb(argument("name", nargs="?", help="the recording; without it: what there is, and where it is kept"))
def fetch_verb(chosen: argparse.Namespace) -> None:
    """Download a public recording, check it, and keep it.

      jerkbench data fetch
      jerkbench data fetch broad

    Raises:
        RecordingError: there is no such recording, or it cannot be had.
    """
    from jerkbench.fetching import fetch, public_recording, public_recordings
    from jerkbench.io.files import fetched_folder

    if chosen.name is None:
        for public in public_recordings().values():
            kept = fetched_folder(public.name)
            state = kept if kept.is_dir() else "not fetched"
            print(f"{public.name}: {public.title} ({public.licence}); {state}")
        return
    recording, folder = public_recording(chosen.name), fetched_folder(chosen.name)
    print(f"{recording.name}: {recording.title}; licence {recording.licence}, {len(recording.files)} files")
    fetch(recording, folder, print)
    print(f"{recording.name} is in {folder}")


@verb(
    *SOURCE_WORDS,
    argument("target", type=Path, help="the file to write, .parquet"),
    argument("--offset", choices=("remove", "keep"), default="remove", help="the median error (default: remove)"),
    argument("--licence", default="", help="of the data, to stand in the file"),
    argument("--origin", default="", help="where the data are, to stand in the file"),
)
def trace_verb(chosen: argparse.Namespace) -> None:
    """Write the errors of a recording's fixes against its reference, to replay them elsewhere.

    Then: jerkbench run disturbance=replayed_gnss disturbance.replayed_gnss.trace=TARGET

      jerkbench data trace field errors.parquet --set duration_s=30
      jerkbench data trace field biased.parquet --set duration_s=30 --offset keep
    """
    from jerkbench.simulation.traces import SUFFIX, read_trace, trace_of, trace_text, write_trace

    target: Path = chosen.target
    require_known("suffix of a trace", target.suffix, [SUFFIX], JerkbenchError)
    require_new(target)
    recording = dataset_of(chosen.source, chosen.dataset, chosen.set).load(chosen.seed)
    centred = chosen.offset == "remove"
    write_trace(trace_of(recording, centred=centred, licence=chosen.licence, origin=chosen.origin), target)
    print(f"{target}: {trace_text(read_trace(target))}")


@verb(argument("--clear", action="store_true", help="delete it; all of it can be made again"))
def cache_verb(chosen: argparse.Namespace) -> None:
    """Show what is kept in the user's cache, or clear it.

    Recordings that were fetched are not in it: they are data.

      jerkbench data cache
      jerkbench data cache --clear
    """
    from jerkbench.compilation import module_cache
    from jerkbench.files import cache_folder
    from jerkbench.io import bag
    from jerkbench.jobs import inputs as simulation_cache

    for title, name, patterns in (
        ("compiled filters and adaptations", module_cache.COMPILED, ("jerkbench_*", "__pycache__/jerkbench_*")),
        ("messages of bags", bag.BAGS, (bag.PATTERN,)),
        ("simulated recordings", simulation_cache.SIMULATED, (simulation_cache.SIMULATED_PATTERN,)),
    ):
        folder = cache_folder(name)
        files = [path for pattern in patterns for path in sorted(folder.glob(pattern)) if path.is_file()]
        megabytes = sum(file.stat().st_size for file in files) / 1e6
        if chosen.clear:
            for file in files:
                file.unlink(missing_ok=True)
        done = ", deleted" if chosen.clear and files else ""
        print(f"{title}: {len(files)} files, {megabytes:.1f} MB in {folder}{done}")
