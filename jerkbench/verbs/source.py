"""The recording behind the words of a person: a file or folder, or the name of a data set."""

import argparse
import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from jerkbench.contracts import Dataset
from jerkbench.errors import PluginError
from jerkbench.verbs.arguments import argument

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


def seed(text: str) -> int:
    """Read the seed of a simulated recording.

    Raises:
        ArgumentTypeError: it is no whole number, or negative.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is no seed; give a whole number, 0 or more")
    return int(text)


SOURCE_WORDS = (
    argument("source", help="a file or folder, or the name of a data set or its preset"),
    argument("--dataset", metavar="NAME", help="the data set that reads the file (default: by its suffix)"),
    argument("--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE", help="parameters of the data set"),
    argument("--seed", type=seed, default=0, help="of a simulated recording (default 0)"),
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
    from jerkbench.jobs.names import choose

    parameters = _parameters(words)
    path = Path(source).expanduser()
    if path.exists():
        return _created(choose("dataset", {**parameters, "name": name or _by_content(path)}).plain, str(path))
    if name is not None or path.name != source or path.suffix:
        raise PluginError(f"There is no file or folder {source}; correct the path.")
    return _created(choose("dataset", {**parameters, "name": source}).plain)


def _created(plain: dict[str, Any], path: str | None = None) -> Dataset:
    """Make the data set; its first parameter is the file or folder that it reads."""
    from jerkbench import plugins

    if path is not None:
        plain = {**plain, dataclasses.fields(plugins.get("dataset", plain["name"]))[0].name: path}
    created: Dataset = plugins.create("dataset", plain)
    return created


def _parameters(words: Sequence[str]) -> dict[str, Any]:
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    wrong = [word for word in words if "=" not in word]
    if wrong:
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
    suffixes = [path.suffix] if path.is_file() else sorted({inside.suffix for inside in path.iterdir()})
    fitting = [SUFFIXES[suffix] for suffix in suffixes if suffix in SUFFIXES]
    if path.is_dir():
        fitting += [name for pattern, name in INSIDE.items() if any(path.glob(pattern))]
    fitting = list(dict.fromkeys(fitting))
    if len(fitting) == 1:
        return fitting[0]
    why = (
        f"could be of {' or '.join(fitting)}"
        if fitting
        else "has no suffix, and holds nothing, that tells its data set"
    )
    raise PluginError(f"{path} {why}; give --dataset NAME ({', '.join(_readers())}).")


def _readers() -> list[str]:
    """Data sets that read files."""
    from jerkbench import plugins

    names = plugins.names("dataset")
    return [n for n in names if dataclasses.fields(plugins.get("dataset", n))[0].name in ("file", "folder")]
