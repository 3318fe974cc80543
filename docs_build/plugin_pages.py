"""Pages of the plugins: a list for each kind, a page for each plugin and preset, and all metrics by their equations."""

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
"""Each kind in the plural."""

METRICS_HEAD = """\
# Every metric by its equation

This page defines every metric. A metric is computed from one run. It compares the estimate with the reference at the
stamps of the reference, from `burn_in_s` on. Nothing is aligned, and nothing is interpolated. The name of a column ends
with its unit. A table shows the median over the seeds with its 95 % interval: [how to read a result](report.md).

`metrics=[all]` computes all metrics. Some are computed only if you ask for them; their text says so.
"""


PARAMETERS_HEAD = """\
| parameter | default | what it is | range of `tune` | where the default comes from |
|---|---|---|---|---|"""


def plugin_pages() -> tuple[dict[str, str | bytes], dict[str, list[Any]]]:
    """Return the content of every page and figure by its path, and the navigation of each kind by its title."""
    pages: dict[str, str | bytes] = {}
    nav: dict[str, list[Any]] = {}
    for kind, title in TITLES.items():
        own = [entry for entry in entries(kind) if entry.package == "jerkbench"]
        figures = FIGURES[kind]([entry.name for entry in own]) if kind in FIGURES else {}
        pages[f"plugins/{kind}/index.md"] = _list_page(kind, title, own, figures)
        pages |= {f"plugins/{kind}/{name}.png": png for name, png in figures.items()}
        pages |= {f"plugins/{kind}/{entry.name}.md": _page(kind, entry, entry.name in figures) for entry in own}
        nav[title] = [f"plugins/{kind}/index.md", *({entry.name: f"plugins/{kind}/{entry.name}.md"} for entry in own)]
    return pages, nav


def metrics_page() -> str:
    """Return the page with every metric's docstring."""
    sections = [METRICS_HEAD]
    for name in plugins.names("metric"):
        documented = _documented("metric", name)
        sections.append(f"## {name}\n\n{documented.body}\n\n{_parameters('metric', name, documented.parameters)}")
    return "\n\n".join(sections)


def _list_page(kind: str, title: str, listed: list[CatalogueEntry], figures: Mapping[str, bytes]) -> str:
    shown_by = f"In a terminal, `jerkbench list {kind}` prints this list, and `jerkbench show {kind} NAME` each page."
    lines = [f"# {title}", "", shown_by, "", "| name | what it is |", "|---|---|", *map(_line, listed)]
    if figures:
        lines += ["", "## Gallery", "", CAPTIONS[kind], "", *_gallery(list(figures))]
    return "\n".join(lines)


def _gallery(names: list[str]) -> list[str]:
    """Return a table of figures, each below its name."""
    cells = [f"[{name}]({name}.md)<br>[![{name}]({name}.png)]({name}.md)" for name in names]
    rows = (cells[k : k + ABREAST] for k in range(0, len(cells), ABREAST))
    return ["| " * ABREAST + "|", "|---" * ABREAST + "|", *(f"| {' | '.join(row)} |" for row in rows)]


ABREAST = 3
"""Figures side by side in a gallery."""


def _line(entry: CatalogueEntry) -> str:
    return f"| [{entry.name}]({entry.name}.md) | {prose(entry.summary)}{' (preset)' * entry.preset} |"


CAPTIONS = {
    "disturbance": (
        "What each does to the same 80 s of `field_white`. The panels show the errors of fixes and velocities, what is "
        "added to the IMU, and the reported sigma. Grey: without the disturbance."
    ),
    "adaptation": (
        "The baseline on the same 80 s of `field_white`, with bursts of multipath on one axis. From 60 s on the noise "
        "doubles. Above: its error with the adaptation and without. Below: the sigma that the adaptation uses for each "
        "fix, divided by the reported one. A row that is dropped is not drawn."
    ),
}
"""What the figures of a kind show."""


def _page(kind: str, entry: CatalogueEntry, drawn: bool) -> str:
    figure = f"![{entry.name}]({entry.name}.png)\n\n{CAPTIONS[kind].replace('What each', 'What it')}" if drawn else ""
    body = _preset_body(kind, entry.name, figure) if entry.preset else _plugin_body(kind, entry.name, figure)
    return f"# {entry.name}\n\n`{_chosen(kind, entry.name)}`\n\n{body}\n"


def _chosen(kind: str, name: str) -> str:
    """Return what one types to have it."""
    return f"metrics=[{name}]" if kind == "metric" else f"{kind}={name}"


def _preset_body(kind: str, name: str, figure: str) -> str:
    text = preset_files(kind)[name].read_text(encoding="utf-8").rstrip()
    return f"This is a preset: a file of values, `conf/{kind}/{name}.yaml`.\n\n```yaml\n{text}\n```\n\n{figure}"


def _plugin_body(kind: str, name: str, figure: str) -> str:
    documented = _documented(kind, name)
    table = _parameters(kind, name, documented.parameters)
    return f"{documented.body}\n\n{figure}\n\n{table}\n\nDefined in `{home(plugin_class(kind, name))}`."


def _documented(kind: str, name: str) -> Docstring:
    """Return a plugin's docstring, with those of the classes that it varies behind it."""
    parts = [parsed(text) for text in docstrings(plugin_class(kind, name))]
    body = "\n\n".join(part.body for part in parts)
    return Docstring(body, {key: text for part in reversed(parts) for key, text in part.parameters.items()})


def _parameters(kind: str, name: str, described: Mapping[str, str]) -> str:
    rows = [_row(parameter, described) for parameter in shown_json(kind, name)["parameters"]]
    if not rows:
        return "It has no parameters."
    return "\n".join([PARAMETERS_HEAD, *rows])


def _row(parameter: Mapping[str, Any], described: Mapping[str, str]) -> str:
    known = parameter.get("range")
    bounds = f"{known['low']:g} to {known['high']:g}" if known else ""
    default = f"`{_plain(parameter['default'])}`" if "default" in parameter else "has to be given"
    meaning = prose(described.get(parameter["name"], ""))
    cells = [f"`{parameter['name']}`", default, meaning, bounds, parameter.get("origin", "")]
    return f"| {' | '.join(cells)} |"


def _plain(value: object) -> str:
    """Return a default as one types it."""
    return '""' if value == "" else str(value)
