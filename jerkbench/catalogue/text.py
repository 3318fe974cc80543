"""The answers of `jerkbench list` and `jerkbench show` as a person reads them."""

import dataclasses
import inspect

from jerkbench.catalogue.entries import Entry, entries, kinds_asked, plugin_class, preset_files
from jerkbench.parameters import origins_of, ranges_of


def list_text(kind: str | None = None) -> str:
    """Every name with one line about it, of every kind or of ``kind``.

    Raises:
        PluginError: no such kind.
    """
    return "\n\n".join(_list_kind(name) for name in kinds_asked(kind))


def show_text(kind: str, name: str) -> str:
    """All there is to know of one plugin or preset.

    Raises:
        PluginError: there is none of that name.
    """
    presets = preset_files(kind)
    if name in presets:
        return f"{kind} {name}: a preset\n\n{presets[name].read_text(encoding='utf-8').rstrip()}"
    cls = plugin_class(kind, name)
    usage = _usage(name, cls) if kind == "disturbance" else []
    return "\n\n".join([f"{kind} {name}", *docstrings(cls), _defaults(cls), *usage, f"Defined in {home(cls)}."])


def _usage(name: str, cls: type) -> list[str]:
    """Return an example of setting a parameter of a disturbance, which stands under its name."""
    return [
        f"On the command line: disturbance={name} disturbance.{name}.{f.name}=..." for f in dataclasses.fields(cls)[:1]
    ]


def docstrings(cls: type) -> list[str]:
    """Return the docstrings of a plugin and of those that it varies; the equations stand with the first."""
    family = [c for c in cls.__mro__ if dataclasses.is_dataclass(c)]
    return [inspect.cleandoc(c.__doc__ or "It has no docstring.") for c in family]


def _list_kind(kind: str) -> str:
    listed = entries(kind)
    width = max((len(entry.name) for entry in listed), default=0)
    return "\n".join([kind, *(f"  {entry.name:<{width}}  {_line(entry)}" for entry in listed)])


def _line(entry: Entry) -> str:
    if entry.preset:
        return f"{entry.summary} (preset)"
    return entry.summary if entry.package == "jerkbench" else f"{entry.summary} [{entry.package}]"


def _defaults(cls: type) -> str:
    fields = dataclasses.fields(cls)
    if not fields:
        return "It has no parameters."
    width = max(len(f.name) for f in fields)
    return "\n".join(["Defaults:", *(f"    {f.name:<{width}} = {_default(f)}" for f in fields), *_tuning(cls)])


def _tuning(cls: type) -> list[str]:
    """Return where each default comes from, and within which bounds `jerkbench tune` looks for a better one."""
    origins, ranges = origins_of(cls), ranges_of(cls)
    known = [f.name for f in dataclasses.fields(cls) if f.name in origins or f.name in ranges]
    lines = ["", "Origin of the defaults, and range for `jerkbench tune`:"] if known else []
    for name in known:
        lines.append(f"    {name}: {origins.get(name, 'not said')}")
        if name in ranges:
            lines.append(f"        range {ranges[name]} ({ranges[name].source})")
    return lines


def _default(f: "dataclasses.Field[object]") -> str:
    if f.default is not dataclasses.MISSING:
        return repr(f.default)
    return "(has to be given)" if f.default_factory is dataclasses.MISSING else repr(f.default_factory())


def home(cls: type) -> str:
    """Return where a class is defined."""
    return f"{cls.__module__}.{cls.__qualname__}"
