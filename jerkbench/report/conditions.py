"""The conditions of a stored job beyond its labels (data, parameters, protocol, engine), as labels."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from jerkbench.report.labels import TUNED_SUFFIX, bare

LABELLED_PARTS = ("dataset", "disturbance", "attitude", "filter", "adaptation")
"""Parts of a job that have a label. The noise is a parameter of the filter."""

DECIDING_SCORES = ("dataset", "disturbance")
"""Parts that decide what is measured and how it is scored."""

METHOD_PARTS = ("filter", "adaptation")
"""Parts that are tuned together."""

PROTOCOL = ("burn_in_s", "divergence_limit_m")
"""Entries of the protocol that change a score."""

PATHS = ("folder", "file")
"""Last words of the parameters that say where data are stored."""

NO_DATA = "none"
"""Digest of simulated data."""

PartValues = dict[str, str]
"""The value of each parameter as text."""

Conditions = Mapping[str, PartValues]
"""The parameters of each of `LABELLED_PARTS`."""


def conditions(metadata: Mapping[str, Any]) -> Conditions:
    """Return the parameters of each part of a stored job. Protocol and engine belong to the data set."""
    spec, protocol = metadata["spec"], metadata["protocol"]
    known = {part: _parameters(part, spec.get(part, {})) for part in LABELLED_PARTS}
    known["dataset"] |= {"data": metadata["data"][:12] or NO_DATA}
    known["dataset"] |= {name: _text(protocol[name]) for name in PROTOCOL if name in protocol}
    known["dataset"] |= _parameters("engine", spec.get("engine", {}))
    known["filter"] = {name: text for name, text in known["filter"].items() if not name.endswith(PATHS)}
    known["filter"] |= _parameters("r_scale", spec.get("r_scale", {}))
    return known


def with_one_name(labels: Sequence[dict[str, str]], known: Sequence[Conditions]) -> None:
    """Give parts with one name and the same parameters one label, the shortest.

    So ``mtf`` and ``mtf(window=1)`` are one method, because 1 is the default of the window.

    Args:
        labels: of each job; they are changed.
        known: the conditions of each job.
    """
    for part in LABELLED_PARTS:
        groups: dict[object, list[dict[str, str]]] = {}
        for label, own in zip(labels, known, strict=True):
            noise = label["noise"] if part == "filter" else ""
            groups.setdefault((bare(label[part]), noise, tuple(own[part].items())), []).append(label)
        for group in groups.values():
            name = min((label[part] for label in group), key=lambda text: (len(text), text))
            for label in group:
                label[part] = name


def told_apart(labels: Sequence[dict[str, str]], known: Sequence[Conditions]) -> list[str]:
    """Add the parameters in which two jobs with one label differ to the labels, so that they are never compared.

    The parameters of a tuned method belong to the pair of its filter and its adaptation.

    Args:
        labels: of each job; they are changed.
        known: the conditions of each job.

    Returns:
        A note for each of these labels.
    """
    notes, unchanged = [], [dict(label) for label in labels]
    for part in LABELLED_PARTS:
        names = (part, "noise") if part == "filter" else (part,)  # the noise is a parameter of the filter
        groups: dict[tuple[str, ...], list[int]] = {}
        for place, label in enumerate(unchanged):
            tuned = part in METHOD_PARTS and label["filter"].endswith(TUNED_SUFFIX)
            names_of_job = (*names, *METHOD_PARTS) if tuned else names
            groups.setdefault(tuple(label[name] for name in names_of_job), []).append(place)
        for (label_of_part, *_), places in groups.items():
            varying = _varying([known[place][part] for place in places])
            if not varying:
                continue
            differing = " and ".join(f"{name} ({', '.join(texts.values())})" for name, texts in varying.items())
            notes.append(
                f"The results of {part} {label_of_part} differ in {differing}: they have different names here and are"
                " not compared."
            )
            for place in places:
                own = known[place][part]
                added = [f"{name.removeprefix(f'{part}.')}={texts[own[name]]}" for name, texts in varying.items()]
                labels[place][part] = with_parameters(label_of_part, added)
    return notes


def with_parameters(label: str, parameters: Sequence[str]) -> str:
    """Return a label with more parameters in its parentheses.

    >>> with_parameters("field(duration_s=30)", ["burn_in_s=0"])
    'field(duration_s=30, burn_in_s=0)'
    """
    joined = ", ".join(parameters)
    return f"{label[:-1]}, {joined})" if label.endswith(")") else f"{label}({joined})"


def differing_conditions(first: Conditions, second: Conditions, parts: Iterable[str]) -> list[str]:
    """Return what two cells differ in, "burn_in_s (0, 10)", for some parts."""
    names = []
    for part in parts:
        varying = _varying([first[part], second[part]])
        names += [
            f"{name} ({texts[first[part][name]]}, {texts[second[part][name]]})" for name, texts in varying.items()
        ]
    return names


def _parameters(part: str, plugins: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> PartValues:
    """Return the parameters of a plugin, or the names and parameters of several disturbances."""
    if isinstance(plugins, Mapping):
        return {f"{part}.{key}": _text(value) for key, value in plugins.items()}
    names = {part: "+".join(str(plugin["name"]) for plugin in plugins)}
    return names | {
        f"{plugin['name']}.{key}" + (f".{place}" if place else ""): _text(value)
        for place, plugin in enumerate(plugins)
        for key, value in plugin.items()
        if key != "name"
    }


def _varying(known: Sequence[PartValues]) -> dict[str, dict[str, str]]:
    """Parameters that differ, each with its values in short; one that some do not have is of other code.

    Where the data have a hash, it decides; places of files only say in better words which data these are.
    """
    shared = [name for name in known[0] if all(name in own for own in known)]
    values = {name: list(dict.fromkeys(own[name] for own in known)) for name in shared}
    differing = {name: texts for name, texts in values.items() if len(texts) > 1}
    places = [name for name in differing if name.endswith(PATHS)]
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
