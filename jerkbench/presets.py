"""The folders of the presets, ours and the user's, and a preset as plain data."""

import os
import re
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from io import StringIO
from pathlib import Path
from typing import Any

from jerkbench.errors import PluginError, unknown
from jerkbench.renamed import new_name

_ASKED = "JERKBENCH_ENV"
"""The environment variable that names those which a configuration may read."""


def config_folder() -> Path:
    """The presets: conf/ of a checkout, or the copy that an installed package carries."""
    package = Path(__file__).parent
    beside, inside = package.parent / "conf", package / "conf"
    return beside if (beside / "config.yaml").is_file() else inside


_of_user: list[Path] = []
"""Folders that --config-dir names; a preset of ours goes before one of the same name there."""


def take_folders(words: Sequence[str]) -> list[str]:
    """Take each ``--config-dir DIR`` out of a command line: its presets count from here on, and no earlier ones.

    Raises:
        PluginError: there is no such folder, no word behind the last --config-dir, or two presets of one name.
    """
    _of_user.clear()
    others, remaining = [], iter(words)
    for word in remaining:
        option, equals, value = word.partition("=")
        if option not in ("--config-dir", "-cd"):
            others.append(word)
            continue
        folder = value if equals else next(remaining, "")
        if not folder or not Path(folder).expanduser().is_dir():
            raise PluginError(
                f"There is no folder '{folder}'; --config-dir names one with presets (dataset/mine.yaml)."
            )
        _of_user.append(Path(folder).expanduser().resolve())
    _require_no_doubles()
    return others


def _require_no_doubles() -> None:
    """Check that no two of the user's folders have a preset of one name: the first would silently stand for both."""
    groups = [path.name for path in config_folder().iterdir() if path.is_dir()]
    found: dict[Path, Path] = {}
    for folder in dict.fromkeys(_of_user):
        for path in sorted(path for group in groups for path in (folder / group).glob("*.yaml")):
            other = found.setdefault(path.relative_to(folder), path)
            if other != path and other.read_bytes() != path.read_bytes():
                raise PluginError(f"{other} and {path} are different presets of one name; rename one of them.")


def folder_words() -> list[str]:
    """Return the override by which Hydra finds the user's presets; none where there are none."""
    paths = ",".join(f'"file://{folder}"' for folder in _of_user)
    return [f"hydra.searchpath=[{paths}]"] if paths else []


def user_folders() -> tuple[Path, ...]:
    """Return the folders that --config-dir has named."""
    return tuple(_of_user)


def preset_files(kind: str) -> dict[str, Path]:
    """Return the file of each preset of a group, by its name, sorted."""
    files = [path for folder in (*reversed(_of_user), config_folder()) for path in (folder / kind).glob("*.yaml")]
    return dict(sorted({path.stem: path for path in files}.items()))


@cache
def default_names() -> Mapping[str, str]:
    """Return what conf/config.yaml chooses for each group: the one place of these defaults."""
    from omegaconf import OmegaConf

    entries: Any = OmegaConf.to_container(OmegaConf.load(config_folder() / "config.yaml").defaults)
    chosen = (item for entry in entries if isinstance(entry, dict) for item in entry.items())
    return {group: name for group, name in chosen if " " not in group and name}  # no overrides, no experiment


_HYDRA = re.compile(r"hydra(?!\w)")
"""Hydra's part of the configuration in a key, a path or a package; other names may begin with these letters."""


def require_harmless(path: Path, content: object, *names: str | None) -> None:
    """Refuse a preset that sets options of Hydra other than the values of a sweep: they write files and create objects.

    Args:
        path: the file.
        content: the content of the file; interpolations are not resolved.
        names: the group of the preset and its package.

    Raises:
        PluginError: the preset sets one of these options, or chooses from one of Hydra's groups.
    """
    values = dict(content) if isinstance(content, dict) else {}
    swept = values.pop("hydra", {})
    for part in ("sweeper", "params"):
        swept = swept.get(part, {}) if isinstance(swept, dict) and set(swept) <= {part} else None
    keys = [*names, values.pop("defaults", ""), *values, *(swept if isinstance(swept, dict) else ["hydra"])]
    if any(_HYDRA.search(str(key)) for key in keys):
        raise PluginError(
            f"{path} sets options of Hydra. A preset in --config-dir may only set hydra.sweeper.params; give all other"
            " options of Hydra on the command line."
        )


def preset_names(kind: str) -> list[str]:
    """Names of the presets of a group, sorted."""
    return list(preset_files(kind))


def preset(kind: str, name: str) -> dict[str, Any]:
    """Return what conf/KIND/NAME.yaml stands for: its ``defaults`` in order, and its own values over them.

    A default that is a preset itself is read in the same way; any other is the name of a plugin, which stands as
    {"name": ...}. Of disturbances, that may be several, each stands under its name. ``noise`` has no plugins.

    Raises:
        PluginError: there is none, or it chooses parts of other groups, which only the command line can do.
    """
    today = new_name(kind, name)
    files = preset_files(kind)
    if today not in files:
        raise PluginError(unknown(f"preset of {kind}", name, files))
    own = _read(files[today])
    defaults = own.pop("defaults", [])
    if kind == "disturbance":
        own = {new_name(kind, key): value for key, value in own.items()}
    if "_self_" not in defaults:
        defaults = [*defaults, "_self_"]
    values: dict[str, Any] = {}
    for entry in defaults:
        values = merged_values(values, own if entry == "_self_" else _default(kind, name, entry))
    return values


def merged_values(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Return both, a mapping inside them merged likewise; where both have a value, that of ``above``."""
    combined = {**below, **above}
    for key in below.keys() & above.keys():
        if isinstance(below[key], dict) and isinstance(above[key], dict):
            combined[key] = merged_values(below[key], above[key])
    return combined


def _read(path: Path) -> dict[str, Any]:
    from omegaconf import OmegaConf
    from yaml import YAMLError

    try:
        content, asked = _parsed(path, path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise PluginError(f"{path} cannot be read: {' '.join(str(error).split())}.") from error
    for name in asked:
        environment_variable(name, None)
    values: Any = OmegaConf.to_container(content, resolve=True)
    return values or {}


@lru_cache(maxsize=256)
def _parsed(path: Path, text: str) -> tuple[Any, list[str]]:
    """A preset, and the environment variables that it names; each method of an audit asks for the same two."""
    from omegaconf import OmegaConf

    from jerkbench.files import require_small

    require_small(text, path)
    content = OmegaConf.load(StringIO(text))
    return content, re.findall(r"\$\{oc\.env:(\w+)", OmegaConf.to_yaml(content))


def environment_variable(name: str, *default: str | None) -> str | None:
    """Return an environment variable that `_ASKED` names: what a configuration resolves stands in tables and files.

    Raises:
        PluginError: it is not named there, or not set, and the configuration gives no default.
    """
    if name not in os.environ.get(_ASKED, "").replace(",", " ").split():
        raise PluginError(
            f"The configuration reads the environment variable {name}, whose value would stand in names and tables;"
            f" if it may, set {_ASKED}={name}."
        )
    if name not in os.environ and not default:
        raise PluginError(f"The configuration reads the environment variable {name}, which is not set; set it.")
    return os.environ.get(name, *default)


def _default(kind: str, preset_name: str, entry: object) -> dict[str, Any]:
    """Return the values behind one entry of the defaults."""
    if not isinstance(entry, str):
        raise PluginError(
            f"The preset {kind}/{preset_name} has {entry} in its defaults; from Python only names of {kind} can stand "
            "there: give the other parts by their own arguments."
        )
    if new_name(kind, entry) in preset_names(kind):
        return preset(kind, entry)
    if kind == "noise":  # the schema: nothing is set
        return {}
    plugin = new_name(kind, entry)
    return {plugin: {"name": plugin}} if kind == "disturbance" else {"name": plugin}
