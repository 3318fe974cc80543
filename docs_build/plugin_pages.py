"""Generated text about plugins: the list of each kind, a page for each plugin and preset, and the metrics."""

from collections.abc import Mapping
from typing import Any

from docstring import Docstring, parsed, prose
from gallery import FIGURES

from jerkbench import plugins
from jerkbench.plugins.catalogue import (
    CatalogueEntry,
    docstrings,
    entries,
    home,
    plugin_class,
    preset_files,
    shown_json,
)

TITLES = {
    "dataset": "Data sets",
    "disturbance": "Disturbances",
    "attitude": "Attitude filters",
    "filter": "Filters",
    "adaptation": "Adaptations",
    "engine": "Engines",
    "metric": "Metrics",
}
"""Title of each kind in the navigation."""

PARAMETERS_HEAD = """\
| parameter | default | meaning | range of `tune` | origin of the default |
|---|---|---|---|---|"""


def plugin_pages() -> tuple[dict[str, str | bytes], dict[str, str], dict[str, list[Any]]]:
    """Return every page and figure by its path, the list of each kind by its page, and the navigation by kind."""
    pages: dict[str, str | bytes] = {}
    lists: dict[str, str] = {}
    nav: dict[str, list[Any]] = {}
    for kind, title in TITLES.items():
        builtin = [entry for entry in entries(kind) if entry.package == "jerkbench"]
        figures = FIGURES[kind]([entry.name for entry in builtin]) if kind in FIGURES else {}
        index = f"plugins/{kind}/index.md"
        lists[index] = _list(builtin, CAPTIONS.get(kind, ""), figures)
        pages |= {f"plugins/{kind}/{name}.png": png for name, png in figures.items()}
        pages |= {f"plugins/{kind}/{entry.name}.md": _page(kind, entry, entry.name in figures) for entry in builtin}
        nav[title] = [{"Overview": index}, *({entry.name: f"plugins/{kind}/{entry.name}.md"} for entry in builtin)]
    return pages, lists, nav


def metric_sections() -> str:
    """Return a section with the docstring and the parameters of each metric."""
    sections = []
    for name in plugins.names("metric"):
        documented = _documented("metric", name)
        sections.append(f"## {name}\n\n{documented.body}\n\n{_parameters('metric', name, documented.parameters)}")
    return "\n\n".join(sections)


def _list(listed: list[CatalogueEntry], caption: str, figures: Mapping[str, bytes]) -> str:
    lines = ["| name | description |", "|---|---|", *map(_line, listed)]
    if figures:
        lines += ["", "## Gallery", "", caption, "", *_gallery(list(figures))]
    return "\n".join(lines)


def _gallery(names: list[str]) -> list[str]:
    """Return a table of figures, each below the name of its plugin."""
    cells = [f"[{name}]({name}.md)<br>[![{name}]({name}.png)]({name}.md)" for name in names]
    rows = (cells[k : k + ABREAST] for k in range(0, len(cells), ABREAST))
    return ["| " * ABREAST + "|", "|---" * ABREAST + "|", *(f"| {' | '.join(row)} |" for row in rows)]


ABREAST = 3
"""Figures in a row of the gallery."""


def _line(entry: CatalogueEntry) -> str:
    return f"| [{entry.name}]({entry.name}.md) | {prose(entry.summary)}{' (preset)' * entry.preset} |"


CAPTIONS = {
    "disturbance": (
        "The disturbance acts on 80 s of `field_white`. The panels show the errors of the measured positions and "
        "velocities, the change of the IMU signals, and the reported standard deviation. Grey: without the disturbance."
    ),
    "adaptation": (
        "The filter `baseline` on 80 s of `field_white` with bursts of multipath on one axis. From 60 s on, the noise "
        "is doubled. Upper panel: position error with and without the adaptation. Lower panel: standard deviation used "
        "for each fix, divided by the reported standard deviation. Rejected measurements are not drawn."
    ),
}
"""Captions of the figures of each kind."""


def _page(kind: str, entry: CatalogueEntry, drawn: bool) -> str:
    figure = f"![{entry.name}]({entry.name}.png)\n\n{CAPTIONS[kind]}" if drawn else ""
    body = _preset_body(kind, entry.name, figure) if entry.preset else _plugin_body(kind, entry.name, figure)
    return f"# {entry.name}\n\n`{_override(kind, entry.name)}`\n\n{body}\n"


def _override(kind: str, name: str) -> str:
    """Return the override that selects the plugin."""
    return f"metrics=[{name}]" if kind == "metric" else f"{kind}={name}"


def _preset_body(kind: str, name: str, figure: str) -> str:
    text = preset_files(kind)[name].read_text(encoding="utf-8").rstrip()
    introduction = f"This is a preset, a file with parameter values: `conf/{kind}/{name}.yaml`."
    return f"{introduction}\n\n```yaml\n{text}\n```\n\n{figure}"


def _plugin_body(kind: str, name: str, figure: str) -> str:
    documented = _documented(kind, name)
    table = _parameters(kind, name, documented.parameters)
    return f"{documented.body}\n\n{figure}\n\n{table}\n\nDefined in `{home(plugin_class(kind, name))}`."


def _documented(kind: str, name: str) -> Docstring:
    """Return the docstring of a plugin, followed by the docstrings of its base classes."""
    parts = [parsed(text) for text in docstrings(plugin_class(kind, name))]
    body = "\n\n".join(part.body for part in parts)
    return Docstring(body, {key: text for part in reversed(parts) for key, text in part.parameters.items()})


def _parameters(kind: str, name: str, described: Mapping[str, str]) -> str:
    rows = [_row(parameter, described) for parameter in shown_json(kind, name)["parameters"]]
    if not rows:
        return "This plugin has no parameters."
    return "\n".join([PARAMETERS_HEAD, *rows])


def _row(parameter: Mapping[str, Any], described: Mapping[str, str]) -> str:
    known = parameter.get("range")
    bounds = f"{known['low']:g} to {known['high']:g}" if known else ""
    default = f"`{_plain(parameter['default'])}`" if "default" in parameter else "required"
    meaning = prose(described.get(parameter["name"], ""))
    cells = [f"`{parameter['name']}`", default, meaning, bounds, parameter.get("origin", "")]
    return f"| {' | '.join(cells)} |"


def _plain(value: object) -> str:
    """Return a default in the syntax of the command line."""
    return '""' if value == "" else str(value)
