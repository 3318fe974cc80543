"""Labels of combinations (names of presets and the parameters that the user set), and further conditions of a job."""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any

from jerkbench import plugins
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.parameters import scale_of

TUNED_SUFFIX, UNTUNED_SUFFIX = ", tuned", ", untuned"
"""Suffixes of the labels of filters with the tuned setting, and with the setting before the tuning."""
REUSED = "The presets were tuned on the seeds "
"""Start of the note about runs with seeds that a tuning used."""


class Labels(Combination):
    """The labels of a job in tables, one for each of the six factors (data set, disturbance, attitude, ...)."""

    @property
    def scenario(self) -> str:
        """The name of the scenario: the labels of data set, disturbance and attitude."""
        return ", ".join(self[:3])


def default_labels(spec: Mapping[str, Any]) -> Labels:
    """Return the labels of a job that Hydra did not compose. The labels are the names of the plugins."""
    names = {kind: spec[kind]["name"] for kind in ("dataset", "attitude", "filter", "adaptation")}
    noise = _with_r_scale("default", spec)
    return Labels(disturbance=joined(d["name"] for d in spec["disturbance"]), noise=noise, **names)


def joined(names: Iterable[str]) -> str:
    """Return the names of several disturbances, joined by "+". The name `none` is left out if there are other names."""
    several = list(names)
    return "+".join(name for name in several if name != "none") or "none"


GROUPS = ("dataset", "attitude", "filter", "adaptation", "engine")
"""Configuration groups that contain exactly one plugin. The group `disturbance` contains several plugins."""


def labels_of(spec: dict[str, Any], choices: Mapping[str, Any], overrides: list[str]) -> Labels:
    """Return the labels of a job: names of presets, with parameters that the command line set in parentheses."""
    changed = _set_parameters(overrides)
    preset_names = {kind: str(choices[kind]) for kind in GROUPS if kind != "engine"}
    tuned = tuned_method(spec, choices)
    names = {kind: _named(name, changed.get(kind, [])) for kind, name in {**preset_names, **tuned}.items()}
    listed = [override.partition("=")[2].strip("[]") for override in overrides if override.startswith("disturbance=")]
    typed = (listed[-1] if listed else str(choices.get("disturbance") or "")).split(",")
    ran = [d["name"] for d in spec["disturbance"]]
    selected = [name.strip() for name in typed if name.strip()] or ran  # presets in the typed order
    also = [name for name in ran if name not in selected and f"disturbance.{name}" in changed]
    disturbance = joined(_named(name, changed.get(f"disturbance.{name}", [])) for name in [*selected, *also])
    noise = _noise_label(spec, choices, changed)
    if not tuned or "r_scale" in changed:  # the r_scale of a tuned method is not part of its label
        noise = _with_r_scale(noise, spec)
    return Labels(disturbance=disturbance, noise=noise, **names)


def tuned_method(spec: Mapping[str, Any], choices: Mapping[str, Any]) -> dict[str, str]:
    """Return the filter and adaptation labels of a method that `jerkbench tune` tuned, or {} for another method.

    A method is tuned if the preset of its filter or its adaptation has a name such as baseline_mtf_tuned. The labels
    contain the names of the plugins instead of the presets, so that tables compare tuned methods with default methods.
    The ending _untuned marks the settings before the tuning.
    """
    filter_, adaptation = (str(spec[kind]["name"]) for kind in ("filter", "adaptation"))
    name = re.compile(rf"{re.escape(filter_)}_{re.escape(adaptation)}(?:_(\d+))?_((?:un)?tuned)")
    matches = [match for kind in ("filter", "adaptation") if (match := name.fullmatch(str(choices[kind])))]
    if not matches:
        return {}
    number, state = matches[0].groups()
    return {"filter": f"{filter_}{f' {number}' if number else ''}, {state}", "adaptation": adaptation}


def _noise_label(spec: dict[str, Any], choices: Mapping[str, Any], changed: dict[str, list[str]]) -> str:
    """Return the label of the process noise: its preset, and the parameters that the command line set.

    The label is "default" for a filter without noise parameters.
    """
    fields_of_filter = {f.name for f in fields(plugins.get("filter", spec["filter"]["name"]))}
    if not fields_of_filter & {key for key, value in spec["noise"].items() if value is not None}:
        return "default"
    preset = str(choices["noise"])
    parameters = [p for p in changed.get("noise", []) if p.split("=")[0] in fields_of_filter]
    return ", ".join(parameters) if preset == "default" else _named(preset, parameters)


def _with_r_scale(noise: str, spec: Mapping[str, Any]) -> str:
    """Return the label of the process noise, followed by the factors on the reported R (``r_scale``) that are not 1."""
    scaled = [f"r_scale.{name}={value:g}" for name, value in scale_of(spec.get("r_scale")).changed.items()]
    return ", ".join([*([noise] if noise != "default" or not scaled else []), *scaled])


def _set_parameters(overrides: list[str]) -> dict[str, list[str]]:
    """Return the texts "parameter=value" of each plugin that the overrides set. File paths are left out."""
    parameters: dict[str, dict[str, str]] = {}
    for override in overrides:
        key, _, value = override.lstrip("+~").partition("=")
        owner, _, name = key.rpartition(".")
        is_path = name in ("folder", "file") or ("/" in value and not name.endswith("_topic"))
        if owner and not key.startswith("hydra") and not is_path:
            parameters.setdefault(owner, {})[name] = value.lower() if value in ("True", "False") else value
    return {owner: [f"{name}={value}" for name, value in values.items()] for owner, values in parameters.items()}


def _named(name: str, parameters: list[str]) -> str:
    return f"{name}({', '.join(parameters)})" if parameters else name


def bare(label: str) -> str:
    """Return a label without its parameters. For example, "bias(accel_mps2=0.1)+dropout" becomes "bias+dropout"."""
    shorter = re.sub(r"\([^()]*\)", "", label)
    return label if shorter == label else bare(shorter)


# Conditions under which a stored job ran, and that its labels do not contain: data, parameters, protocol, engine.

LABELLED_PARTS = ("dataset", "disturbance", "attitude", "filter", "adaptation")
"""Parts of a job that have a label. The noise is a parameter of the filter."""

DECIDING_SCORES = ("dataset", "disturbance")
"""Parts that determine the measurements and the evaluation."""

METHOD_PARTS = ("filter", "adaptation")
"""Parts that form a method and are tuned together."""

PROTOCOL = ("burn_in_s", "divergence_limit_m")
"""Entries of the protocol that influence the metrics."""

PATHS = ("folder", "file")
"""Last parts of the names of parameters that contain the path of data."""

NO_DATA = "none"
"""Value that replaces the digest of the data for simulated data."""

PartValues = dict[str, str]
"""The values of parameters as text, by the name of the parameter."""

Conditions = Mapping[str, PartValues]
"""The parameters of each part in `LABELLED_PARTS`."""


def conditions(metadata: Mapping[str, Any]) -> Conditions:
    """Return the parameters of each part of a stored job. The entry "dataset" also contains protocol and engine."""
    spec, protocol = metadata["spec"], metadata["protocol"]
    known = {part: _parameters(part, spec.get(part, {})) for part in LABELLED_PARTS}
    known["dataset"] |= {"data": metadata["data"][:12] or NO_DATA}
    known["dataset"] |= {name: _text(protocol[name]) for name in PROTOCOL if name in protocol}
    known["dataset"] |= _parameters("engine", spec.get("engine", {}))
    known["filter"] = {name: text for name, text in known["filter"].items() if not name.endswith(PATHS)}
    known["filter"] |= _parameters("r_scale", spec.get("r_scale", {}))
    return known


def with_one_name(labels: Sequence[dict[str, str]], known: Sequence[Conditions]) -> None:
    """Give parts with the same name and the same parameters one label: the shortest of their labels.

    For example, ``mtf`` and ``mtf(window=1)`` are the same method, because the default of the window is 1.

    Args:
        labels: labels of each job, by factor. The function changes these mappings in place.
        known: parameters of the parts of each job, as returned by `conditions`.
    """
    for part in LABELLED_PARTS:
        groups: dict[object, list[dict[str, str]]] = {}
        for label, values in zip(labels, known, strict=True):
            noise = label["noise"] if part == "filter" else ""
            groups.setdefault((bare(label[part]), noise, tuple(values[part].items())), []).append(label)
        for group in groups.values():
            name = min((label[part] for label in group), key=lambda text: (len(text), text))
            for label in group:
                label[part] = name


def with_distinct_labels(labels: Sequence[dict[str, str]], known: Sequence[Conditions]) -> list[str]:
    """Extend the labels of jobs that differ in parameters, so that the results of different jobs are never averaged.

    If jobs with the same label have different parameters, the differing parameters are added to the label. The jobs of
    a tuned method are compared only with jobs that have the same labels of both filter and adaptation.

    Args:
        labels: labels of each job, by factor. The function changes these mappings in place.
        known: parameters of the parts of each job, as returned by `conditions`.

    Returns:
        A note for each label to which parameters were added.
    """
    notes, unchanged = [], [dict(label) for label in labels]
    for part in LABELLED_PARTS:
        names = (part, "noise") if part == "filter" else (part,)  # the noise belongs to the filter
        groups: dict[tuple[str, ...], list[int]] = {}
        for index, label in enumerate(unchanged):
            tuned = part in METHOD_PARTS and label["filter"].endswith((TUNED_SUFFIX, UNTUNED_SUFFIX))
            names_of_job = (*names, *METHOD_PARTS) if tuned else names
            groups.setdefault(tuple(label[name] for name in names_of_job), []).append(index)
        for (label_of_part, *_), places in groups.items():
            varying = _varying([known[index][part] for index in places])
            if not varying:
                continue
            differing = " and ".join(f"{name} ({', '.join(texts.values())})" for name, texts in varying.items())
            notes.append(
                f"The results of {part} {label_of_part} differ in {differing}: they have different names here and are"
                " not compared."
            )
            for index in places:
                values_of_job = known[index][part]
                added = [
                    f"{name.removeprefix(f'{part}.')}={texts[values_of_job[name]]}" for name, texts in varying.items()
                ]
                labels[index][part] = with_parameters(label_of_part, added)
    return notes


def with_parameters(label: str, parameters: Sequence[str]) -> str:
    """Return a label with ``parameters`` added in the parentheses of the label.

    >>> with_parameters("field(duration_s=30)", ["burn_in_s=0"])
    'field(duration_s=30, burn_in_s=0)'
    """
    added = ", ".join(parameters)
    return f"{label[:-1]}, {added})" if label.endswith(")") else f"{label}({added})"


def differing_conditions(first: Conditions, second: Conditions, parts: Iterable[str]) -> list[str]:
    """Return the differing parameters of two jobs with both values, for example "burn_in_s (0, 10)"."""
    names = []
    for part in parts:
        varying = _varying([first[part], second[part]])
        names += [
            f"{name} ({texts[first[part][name]]}, {texts[second[part][name]]})" for name, texts in varying.items()
        ]
    return names


def _parameters(part: str, plugins: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> PartValues:
    """Return the parameters of one plugin, or the names and parameters of a list of disturbances."""
    if isinstance(plugins, Mapping):
        return {f"{part}.{key}": _text(value) for key, value in plugins.items()}
    names = {part: "+".join(str(plugin["name"]) for plugin in plugins)}
    return names | {
        f"{plugin['name']}.{key}" + (f".{index}" if index else ""): _text(value)
        for index, plugin in enumerate(plugins)
        for key, value in plugin.items()
        if key != "name"
    }


def _varying(known: Sequence[PartValues]) -> dict[str, dict[str, str]]:
    """Return the parameters that differ between jobs, with a (possibly shortened) text for each value.

    Parameters that some jobs do not have are ignored. If the hashes of the data differ, the differing file paths are
    returned instead of the hashes, because paths are easier to read. Equal hashes mean equal data, so different file
    paths are ignored.
    """
    shared = [name for name in known[0] if all(name in values_of_job for values_of_job in known)]
    values = {name: list(dict.fromkeys(values_of_job[name] for values_of_job in known)) for name in shared}
    differing = {name: texts for name, texts in values.items() if len(texts) > 1}
    places = [name for name in differing if name.endswith(PATHS)]
    if "data" in differing:
        shown = [name for name in differing if name != "data" or not places]
    else:
        hashed = values.get("data", [NO_DATA]) != [NO_DATA]
        shown = [name for name in differing if not (hashed and name in places)]
    return {name: dict(zip(differing[name], _short(differing[name]), strict=True)) for name in shown}


def _short(texts: Sequence[str]) -> list[str]:
    """Return the last part of each path. If the last parts are not all different, return the full paths."""
    ends = [text.rstrip("/").rpartition("/")[2] for text in texts]
    return ends if len(set(ends)) == len(texts) else list(texts)


def _text(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, default=str)
