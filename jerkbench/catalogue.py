"""The lists of `jerkbench list` and `jerkbench show`: plugins from their docstrings, presets from their files."""

import dataclasses
import inspect
import itertools
from collections.abc import Iterator
from pathlib import Path

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.notices import notify

PRESET_GROUPS = ("noise", "experiment")
"""Groups that hold presets only."""


def list_text(kind: str | None = None) -> str:
    """Every name with one line about it, of every kind or of ``kind``.

    Raises:
        PluginError: no such kind.
    """
    kinds = (*plugins.KINDS, *PRESET_GROUPS)
    if kind is not None and kind not in kinds:
        raise PluginError(unknown("kind", kind, kinds))
    return "\n\n".join(_list_kind(name) for name in ([kind] if kind else kinds))


def show_text(kind: str, name: str) -> str:
    """All there is to know of one plugin or preset.

    Raises:
        PluginError: there is none of that name.
    """
    presets = _presets(kind)
    if name in presets:
        return f"{kind} {name}: a preset\n\n{presets[name].read_text(encoding='utf-8').rstrip()}"
    if kind in PRESET_GROUPS:
        raise PluginError(unknown(kind, name, presets))
    if kind in plugins.KINDS and name not in plugins.names(kind):
        raise PluginError(plugins.no_such(kind, name, presets))
    cls = plugins.get(kind, name)
    usage = _usage(name, cls) if kind == "disturbance" else []
    return "\n\n".join([f"{kind} {name}", *_docs(cls), _defaults(cls), *usage, f"Defined in {_home(cls)}."])


def _usage(name: str, cls: type) -> list[str]:
    """Return an example of setting a parameter of a disturbance, which stands under its name."""
    return [
        f"On the command line: disturbance={name} disturbance.{name}.{f.name}=..." for f in dataclasses.fields(cls)[:1]
    ]


def _docs(cls: type) -> list[str]:
    """The docstrings of a plugin and of the plugins that it varies; the equations stand with the first of them."""
    family = [c for c in cls.__mro__ if dataclasses.is_dataclass(c)]
    return [inspect.cleandoc(c.__doc__ or "It has no docstring.") for c in family]


def _list_kind(kind: str) -> str:
    lines = dict(_plugin_lines(kind)) if kind in plugins.KINDS else {}
    for sentence in plugins.left_out(kind).values() if kind in plugins.KINDS else ():
        notify(sentence)
    lines.update({name: f"{_first_comment(path)} (preset)" for name, path in _presets(kind).items()})
    width = max(map(len, lines), default=0)
    return "\n".join([kind, *(f"  {name:<{width}}  {line}" for name, line in sorted(lines.items()))])


def _plugin_lines(kind: str) -> Iterator[tuple[str, str]]:
    for name in plugins.names(kind):
        cls = plugins.get(kind, name)
        foreign = "" if plugins.is_own(cls) else f" [{cls.__module__.split('.')[0]}]"
        yield name, (inspect.getdoc(cls) or "").split("\n", 1)[0] + foreign


def _presets(kind: str) -> dict[str, Path]:
    from jerkbench.presets import config_folder

    return {path.stem: path for path in sorted((config_folder() / kind).glob("*.yaml"))}


def _first_comment(path: Path) -> str:
    """The first sentence of the comment at the top of a preset."""
    comment = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
    text = " ".join(line.lstrip("# ") for line in comment if "@package" not in line)
    return text.split(". ")[0].rstrip(".") + "."


def _defaults(cls: type) -> str:
    fields = dataclasses.fields(cls)
    if not fields:
        return "It has no parameters."
    width = max(len(f.name) for f in fields)
    return "\n".join(["Defaults:", *(f"    {f.name:<{width}} = {_default(f)}" for f in fields)])


def _default(f: "dataclasses.Field[object]") -> str:
    if f.default is not dataclasses.MISSING:
        return repr(f.default)
    return "(has to be given)" if f.default_factory is dataclasses.MISSING else repr(f.default_factory())


def _home(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"
