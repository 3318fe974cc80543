"""The conditions that a cell was measured under, beyond what its labels say: data, parameters, protocol, engine."""

import json
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from jerkbench.jobs.labels import bare
from jerkbench.jobs.parts import Stored
from jerkbench.report.columns import TUNED_SUFFIX

LABELLED_PARTS = ("dataset", "disturbance", "attitude", "filter", "adaptation")
"""Parts of a cell that a label stands for; the noise is a parameter of the filter."""

DECIDING_SCORES = ("dataset", "disturbance")
"""Parts that decide what was measured and how it was scored, not which method was run."""

METHOD_PARTS = ("filter", "adaptation")
"""Parts that are tuned together."""

PROTOCOL = ("burn_in_s", "divergence_limit_m")
"""Entries of the protocol that change a score; of different seeds, the shared ones are compared."""

_PLACES = ("folder", "file")
"""Ends of the parameters that say where data are; estimates from elsewhere have another file in each scenario."""

NO_DATA = "none"
"""In the place of the hash of data that were drawn, not read."""

BESIDE = {"dataset": ("engine",), "filter": ("r_scale",)}
"""Parts of a specification whose parameters belong to those of another."""

NO_PARAMETERS: Mapping[str, Any] = {}
"""Of a part that a specification lacks."""

ConditionValues = dict[str, str]
"""Parameter -> its value as text."""

Conditions = Mapping[str, ConditionValues]
"""Of each of `LABELLED_PARTS`."""


def conditions(cells: Iterable[Mapping[str, Any]]) -> list[Conditions]:
    """Return the parameters of each part of each cell; the protocol and the engine belong to the data set.

    Args:
        cells: the metadata of each. Parts that are one object are so in the answer too: most of many cells are.
    """
    known: dict[object, ConditionValues] = {}
    kept = list(cells)  # as long as they are, no two of their parts have one id
    return [{part: _of_part(part, cell, known) for part in LABELLED_PARTS} for cell in kept]


def with_one_name(cells: Sequence[Stored]) -> list[Stored]:
    """Return the cells; parts of one name and the same parameters have one label, the shortest.

    So ``mtf`` and ``mtf(window=1)``, whose window is 1 unless one says otherwise, are one method.
    """
    labels, known = [dict(cell.metadata["labels"]) for cell in cells], dict[object, ConditionValues]()
    for part in LABELLED_PARTS:
        spelled = Counter(map(bare, {label[part] for label in labels}))
        groups: dict[object, list[dict[str, str]]] = {}
        for cell, label in zip(cells, labels, strict=True):
            if spelled[bare(label[part])] > 1:
                noise = label["noise"] if part == "filter" else ""
                alike = bare(label[part]), noise, tuple(_of_part(part, cell.metadata, known).items())
                groups.setdefault(alike, []).append(label)
        for group in groups.values():
            name = min((label[part] for label in group), key=lambda text: (len(text), text))
            for label in group:
                label[part] = name
    return [replace(cell, metadata={**cell.metadata, "labels": own}) for cell, own in zip(cells, labels, strict=True)]


def told_apart(
    cells: Sequence[Mapping[str, Any]], known: Sequence[Conditions]
) -> tuple[list[dict[str, str]], list[str]]:
    """Return the labels of each cell, with what two cells of one label differ in, and a sentence for each such label.

    What was not measured under the same conditions so has another name, and is never compared. The parameters of a
    tuned method belong to the pair of its filter and its adaptation.

    Args:
        cells: the metadata of each.
        known: their `conditions`.
    """
    labels = [dict(cell["labels"]) for cell in cells]
    remarks = []
    for part in LABELLED_PARTS:
        names = (part, "noise") if part == "filter" else (part,)  # a filter's parameters are those of its noise too
        groups: dict[tuple[str, ...], list[int]] = {}
        for place, cell in enumerate(cells):
            tuned = part in METHOD_PARTS and cell["labels"]["filter"].endswith(TUNED_SUFFIX)
            names_of_cell = (*names, *METHOD_PARTS) if tuned else names
            groups.setdefault(tuple(cell["labels"][name] for name in names_of_cell), []).append(place)
        for label, places in groups.items():
            varying = _varying(list({id(known[place][part]): known[place][part] for place in places}.values()))
            if varying:
                differing = " and ".join(f"{name} ({', '.join(texts.values())})" for name, texts in varying.items())
                remarks.append(
                    f"The results of {part} {label[0]} differ in {differing}: they have different names here and are"
                    " not compared."
                )
                for place in places:
                    own = known[place][part]
                    of_cell = [f"{n.removeprefix(f'{part}.')}={texts[own[n]]}" for n, texts in varying.items()]
                    labels[place][part] = with_parameters(label[0], of_cell)
    return labels, remarks


def _of_part(part: str, cell: Mapping[str, Any], known: dict[object, ConditionValues]) -> ConditionValues:
    """The parameters of one part of a cell, once for all cells that share it."""
    spec, protocol = cell["spec"], cell["protocol"]
    own, others = spec.get(part, NO_PARAMETERS), [spec.get(name, NO_PARAMETERS) for name in BESIDE.get(part, ())]
    measured = (id(protocol), cell["data"]) if part == "dataset" else ()
    which = (part, id(own), *map(id, others), *measured)
    if which not in known:
        known[which] = _parameters(part, own)
        if part == "dataset":
            scored = {name: _text(protocol[name]) for name in PROTOCOL if name in protocol}
            known[which] |= {"data": cell["data"][:12] or NO_DATA, **scored}
        if part == "filter":
            known[which] = {name: text for name, text in known[which].items() if not name.endswith(_PLACES)}
        for name, plugin in zip(BESIDE.get(part, ()), others, strict=True):
            known[which] |= _parameters(name, plugin)
    return known[which]


def differing_conditions(first: Conditions, second: Conditions, parts: Iterable[str]) -> list[str]:
    """Return what two cells differ in, "burn_in_s (0, 10)", for some parts."""
    names = []
    for part in parts:
        varying = _varying([first[part], second[part]])
        names += [
            f"{name} ({texts[first[part][name]]}, {texts[second[part][name]]})" for name, texts in varying.items()
        ]
    return names


def with_parameters(label: str, parameters: Sequence[str]) -> str:
    """Return a label with more parameters in its parentheses.

    >>> with_parameters("field(duration_s=30)", ["burn_in_s=0"])
    'field(duration_s=30, burn_in_s=0)'
    """
    if not parameters:
        return label
    joined = ", ".join(parameters)
    return f"{label[:-1]}, {joined})" if label.endswith(")") else f"{label}({joined})"


def _parameters(part: str, plugins: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> ConditionValues:
    """The parameters of a plugin, or of several disturbances in order, whose names and places are conditions too."""
    if isinstance(plugins, Mapping):
        return {f"{part}.{key}": _text(value) for key, value in plugins.items()}
    names = {part: "+".join(str(plugin["name"]) for plugin in plugins)}
    return names | {
        f"{plugin['name']}.{key}" + (f".{place}" if place else ""): _text(value)
        for place, plugin in enumerate(plugins)
        for key, value in plugin.items()
        if key != "name"
    }


def _varying(known: Sequence[ConditionValues]) -> dict[str, dict[str, str]]:
    """Parameters that differ, each with its values in short; one that some do not have is of other code.

    Where the data have a hash, it decides; places of files only say in better words which data these are.
    """
    shared = [name for name in known[0] if all(name in own for own in known)]
    values = {name: list(dict.fromkeys(own[name] for own in known)) for name in shared}
    differing = {name: texts for name, texts in values.items() if len(texts) > 1}
    places = [name for name in differing if name.endswith(_PLACES)]
    if "data" in differing:
        shown = [name for name in differing if name != "data" or not places]
    else:
        hashed = values.get("data", [NO_DATA]) != [NO_DATA]
        shown = [name for name in differing if not (hashed and name in places)]
    return {name: dict(zip(differing[name], _short(differing[name]), strict=True)) for name in shown}


def _short(texts: Sequence[str]) -> list[str]:
    """The last parts of paths, as long as these differ."""
    ends = [text.rstrip("/").rpartition("/")[2] for text in texts]
    return ends if len(set(ends)) == len(texts) else list(texts)


def _text(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, default=str)


# Which cells of a study are shown, of several with one name.


def current(cells: Sequence[Stored], order: Mapping[str, int], preferred: Collection[str]) -> list[Stored]:
    """Choose the cells that are shown: of the same labels a preferred one, else the newest.

    Args:
        cells: all of them.
        order: place of each key in the sweeps; cells that are not in it come last, by their labels.
        preferred: keys that are taken before others.
    """
    groups: dict[tuple[str, ...], list[Stored]] = {}
    named = [(order.get(cell.key, len(order)), tuple(cell.metadata["labels"].values()), cell) for cell in cells]
    for _, labels, cell in sorted(named, key=lambda entry: entry[:2]):
        groups.setdefault(labels, []).append(cell)
    return [max(own, key=lambda cell: (cell.key in preferred, cell.metadata["created"])) for own in groups.values()]
