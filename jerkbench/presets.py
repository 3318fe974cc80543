"""The folders of built-in presets and user presets, and functions that read presets as plain data."""

import os
import re
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from io import StringIO
from pathlib import Path
from typing import Any

from jerkbench.errors import PluginError, require_known
from jerkbench.renamed import new_name

_VARIABLES_ALLOWED = "JERKBENCH_ENV"
"""Environment variable with a list of the environment variables that a configuration may read."""


def config_folder() -> Path:
    """Return the folder of the built-in presets: conf/ in a checkout, or its copy in an installed package."""
    package = Path(__file__).parent
    beside, inside = package.parent / "conf", package / "conf"
    return beside if (beside / "config.yaml").is_file() else inside


_of_user: list[Path] = []
"""Folders of --config-dir. If a built-in preset has the same name as a preset in these folders, the preset in these
folders is used."""


def take_folders(arguments: Sequence[str]) -> list[str]:
    """Store the folders of all options ``--config-dir DIR`` of a command line, and return the other arguments.

    Each call replaces the folders of the previous call.

    Raises:
        PluginError: A folder does not exist, or two folders have different presets with the same name.
    """
    _of_user.clear()
    others, remaining = [], iter(arguments)
    for argument in remaining:
        option, equals, value = argument.partition("=")
        if option not in ("--config-dir", "-cd"):
            others.append(argument)
            continue
        given = value if equals else next(remaining, "")
        if not given or not Path(given).expanduser().is_dir():
            raise PluginError(f"The folder '{given}' does not exist; --config-dir needs a folder of presets.")
        _of_user.append(Path(given).expanduser().resolve())
    _require_no_doubles()
    return others


def _require_no_doubles() -> None:
    """Require that no two folders have different presets with one name, because Hydra would silently use the first."""
    groups = [path.name for path in config_folder().iterdir() if path.is_dir()]
    found: dict[Path, Path] = {}
    for folder in dict.fromkeys(_of_user):
        for path in sorted(path for group in groups for path in (folder / group).glob("*.yaml")):
            other = found.setdefault(path.relative_to(folder), path)
            if other != path and other.read_bytes() != path.read_bytes():
                raise PluginError(f"{other} and {path} are different presets with the same name; rename one file.")


def search_path_overrides() -> list[str]:
    """Return the override that adds the folders of --config-dir to Hydra's search path, or [] without --config-dir."""
    paths = ",".join(f'"file://{folder}"' for folder in _of_user)
    return [f"hydra.searchpath=[{paths}]"] if paths else []


def user_folders() -> tuple[Path, ...]:
    """Return the folders of --config-dir."""
    return tuple(_of_user)


def preset_files(kind: str) -> dict[str, Path]:
    """Return the files of the presets of a group, sorted by the name of the preset."""
    files = [path for folder in (*reversed(_of_user), config_folder()) for path in (folder / kind).glob("*.yaml")]
    return dict(sorted({path.stem: path for path in files}.items()))


@cache
def default_names() -> Mapping[str, str]:
    """Return the name of the default preset or plugin of each group, as defined in conf/config.yaml."""
    from omegaconf import OmegaConf

    entries: Any = OmegaConf.to_container(OmegaConf.load(config_folder() / "config.yaml").defaults)
    choices = (item for entry in entries if isinstance(entry, dict) for item in entry.items())
    return {group: name for group, name in choices if " " not in group and name}  # omit overrides and experiments


_HYDRA = re.compile(r"hydra(?!\w)")
"""The word hydra in a key, a path or a package. It does not match longer words that start with these letters."""


def require_harmless(path: Path, content: object, *names: str | None) -> None:
    """Reject a preset that sets options of Hydra, which can write files and create objects.

    A preset may set only one option of Hydra: hydra.sweeper.params, which contains the values of a sweep.

    Args:
        path: Path of the preset, for the error message.
        content: The content of the file with unresolved interpolations.
        names: The Hydra group and the Hydra package of the preset, or None for an unknown name.

    Raises:
        PluginError: The preset sets an option of Hydra that is not allowed, or chooses from a group of Hydra.
    """
    values = dict(content) if isinstance(content, dict) else {}
    swept = values.pop("hydra", {})
    for part in ("sweeper", "params"):
        swept = swept.get(part, {}) if isinstance(swept, dict) and set(swept) <= {part} else None
    keys = [*names, values.pop("defaults", ""), *values, *(swept if isinstance(swept, dict) else ["hydra"])]
    if any(_HYDRA.search(str(key)) for key in keys):
        allowed = "A preset in --config-dir may set only the option hydra.sweeper.params"
        raise PluginError(f"{path} sets options of Hydra. {allowed}; give other options on the command line.")


def preset(kind: str, name: str) -> dict[str, Any]:
    """Return the values of conf/KIND/NAME.yaml: the ``defaults`` in order, overridden by the other values in the file.

    If the name of a preset is in ``defaults``, the preset is resolved recursively. Any other name in ``defaults`` is a
    plugin and becomes {"name": ...}. A preset of disturbances maps the name of each disturbance to its values. In the
    group ``noise``, which has no plugins, such a name is ignored.

    Raises:
        PluginError: The preset is unknown, cannot be read, or chooses parts of other groups, which is supported only on
            the command line.
    """
    today = new_name(kind, name)
    files = preset_files(kind)
    require_known(f"preset of {kind}", today, files)
    content = _read(files[today])
    defaults = content.pop("defaults", [])
    if kind == "disturbance":
        content = {new_name(kind, key): value for key, value in content.items()}
    if "_self_" not in defaults:
        defaults = [*defaults, "_self_"]
    values: dict[str, Any] = {}
    for entry in defaults:
        values = merged_values(values, content if entry == "_self_" else _default(kind, name, entry))
    return values


def merged_values(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Merge two mappings recursively. If both mappings have a value for a key, the value in ``above`` is used."""
    combined = {**below, **above}
    for key in below.keys() & above.keys():
        if isinstance(below[key], dict) and isinstance(above[key], dict):
            combined[key] = merged_values(below[key], above[key])
    return combined


def _read(path: Path) -> dict[str, Any]:
    from omegaconf import OmegaConf
    from yaml import YAMLError

    try:
        content, variables = _parsed(path, path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise PluginError(f"{path} cannot be read: {' '.join(str(error).split())}.") from error
    for name in variables:
        environment_variable(name, None)
    values: Any = OmegaConf.to_container(content, resolve=True)
    return values or {}


@lru_cache(maxsize=256)
def _parsed(path: Path, text: str) -> tuple[Any, list[str]]:
    """Return a preset and the environment variables that the preset reads. The text is the key of the cache."""
    from omegaconf import OmegaConf

    from jerkbench.files import require_small

    require_small(text, path)
    content = OmegaConf.load(StringIO(text))
    return content, re.findall(r"\$\{oc\.env:(\w+)", OmegaConf.to_yaml(content))


def environment_variable(name: str, *default: str | None) -> str | None:
    """Return the value of an environment variable that JERKBENCH_ENV lists. Tables may print these values.

    Raises:
        PluginError: The variable is not allowed, or it is not set and the configuration has no default.
    """
    if name not in os.environ.get(_VARIABLES_ALLOWED, "").replace(",", " ").split():
        allowing = f"to allow its value in names and tables, set {_VARIABLES_ALLOWED}={name}"
        raise PluginError(f"The configuration reads the environment variable {name}; {allowing}.")
    if name not in os.environ and not default:
        raise PluginError(f"The configuration reads the environment variable {name}, which is not set; set {name}.")
    return os.environ.get(name, *default)


def _default(kind: str, preset_name: str, entry: object) -> dict[str, Any]:
    if not isinstance(entry, str):
        advice = f"in Python, only names of {kind} are allowed there; give other parts as arguments"
        raise PluginError(f"The preset {kind}/{preset_name} has {entry} in its defaults; {advice}.")
    if new_name(kind, entry) in preset_files(kind):
        return preset(kind, entry)
    if kind == "noise":  # this default is the schema, which sets no values
        return {}
    plugin = new_name(kind, entry)
    return {plugin: {"name": plugin}} if kind == "disturbance" else {"name": plugin}
