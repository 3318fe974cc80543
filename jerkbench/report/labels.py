"""Labels of a combination: names of its choices, with the parameters that were set."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

from jerkbench import plugins
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.r_scale import scale_of
from jerkbench.renamed import new_name

TUNED_SUFFIX = ", tuned"
"""End of the label of a filter whose presets `jerkbench tune` wrote."""


class Labels(Combination):
    """The names of the parts of a cell in the tables."""

    @property
    def scenario(self) -> str:
        """The name of the scenario, whatever is run over it."""
        return ", ".join(self[:3])


def default_labels(spec: Mapping[str, Any]) -> Labels:
    """The plugins' own names."""
    names = {kind: spec[kind]["name"] for kind in ("dataset", "attitude", "filter", "adaptation")}
    noise = _with_told("default", spec)
    return Labels(disturbance=joined(d["name"] for d in spec["disturbance"]), noise=noise, **names)


def joined(names: Iterable[str]) -> str:
    """One name for a list of disturbances; `none` only when it is the only one."""
    several = list(names)
    return "+".join(name for name in several if name != "none") or "none"


GROUPS = ("dataset", "attitude", "filter", "adaptation", "engine")
"""Groups of which a configuration holds one plugin; `disturbance` holds several."""


def labels_of(spec: dict[str, Any], choices: Mapping[str, Any], overrides: list[str]) -> Labels:
    """Names of the choices, with the parameters that the overrides set in parentheses."""
    changed = _parameters(overrides)
    chosen_names = {kind: str(choices[kind]) for kind in GROUPS if kind != "engine"}
    tuned = tuned_method(spec, choices)
    names = {kind: _named(name, changed.get(kind, [])) for kind, name in {**chosen_names, **tuned}.items()}
    listed = [word.partition("=")[2].strip("[]") for word in overrides if word.startswith("disturbance=")]
    typed = (listed[-1] if listed else str(choices.get("disturbance") or "")).split(",")
    ran = [d["name"] for d in spec["disturbance"]]
    chosen = [name.strip() for name in typed if name.strip()] or ran  # presets too, in their order
    also = [name for name in ran if name not in chosen and f"disturbance.{name}" in changed]
    disturbance = joined(_named(name, changed.get(f"disturbance.{name}", [])) for name in [*chosen, *also])
    noise = _noise_label(spec, choices, changed)
    if not tuned or "r_scale" in changed:  # the factors on R belong to the tuned method
        noise = _with_told(noise, spec)
    return Labels(disturbance=disturbance, noise=noise, **names)


def tuned_method(spec: Mapping[str, Any], choices: Mapping[str, Any]) -> dict[str, str]:
    """Return the labels of filter and adaptation if `jerkbench tune` wrote a preset of one of them; else nothing.

    A tuned method has two presets with one name, such as baseline_mtf_tuned. With the names of its plugins as labels,
    tuned and default methods are rows and columns of the same table.
    """
    filter_, adaptation = (str(spec[kind]["name"]) for kind in ("filter", "adaptation"))
    name = re.compile(rf"{re.escape(filter_)}_{re.escape(adaptation)}(?:_(\d+))?_tuned")
    matches = [match for kind in ("filter", "adaptation") if (match := name.fullmatch(str(choices[kind])))]
    if not matches:
        return {}
    number = f" {matches[0][1]}" if matches[0][1] else ""
    return {"filter": f"{filter_}{number}{TUNED_SUFFIX}", "adaptation": adaptation}


def contradiction(labels: Mapping[str, str], spec: Mapping[str, Any]) -> str:
    """Return how the label of a stored cell names another plugin than the one that ran; empty where none does.

    A label that is no plugin's name is a preset's, maybe of another machine: it is believed. A program has the name
    that it gives itself.
    """
    disturbances = spec["disturbance"] or [{"name": "none"}]
    ran = {kind: {new_name(kind, spec[kind]["name"])} for kind in ("dataset", "attitude", "filter", "adaptation")}
    ran["disturbance"] = {new_name("disturbance", disturbance["name"]) for disturbance in disturbances}
    for kind, names in ran.items():
        if labels[kind].endswith("(program)"):
            continue
        heads = re.sub(r"\([^()]*\)", "", labels[kind]).split("+")
        wrong = [head for head in heads if head not in names and head in plugins.names(kind)]
        if wrong:
            return f"{kind}={wrong[0]} is {', '.join(sorted(map(str, names)))}"
    return ""


def _noise_label(spec: dict[str, Any], choices: Mapping[str, Any], changed: dict[str, list[str]]) -> str:
    """The preset or the swept values; "default" for a filter that has none of the fields."""
    own = {f.name for f in fields(plugins.get("filter", spec["filter"]["name"]))}
    if not own & {key for key, value in spec["noise"].items() if value is not None}:
        return "default"
    preset = str(choices["noise"])
    parameters = [p for p in changed.get("noise", []) if p.split("=")[0] in own]
    return ", ".join(parameters) if preset == "default" else _named(preset, parameters)


def _with_told(noise: str, spec: Mapping[str, Any]) -> str:
    """The noise with the factors on the reported R that are not 1: both are what the filter is told of noise."""
    told = [f"r_scale.{name}={value:g}" for name, value in scale_of(spec.get("r_scale")).changed.items()]
    return ", ".join([*([noise] if noise != "default" or not told else []), *told])


def _parameters(overrides: list[str]) -> dict[str, list[str]]:
    """Parameters set by overrides, "key=value", for each plugin; places of files are no label."""
    parameters: dict[str, dict[str, str]] = {}
    for override in overrides:
        key, _, value = override.lstrip("+~").partition("=")
        owner, _, name = key.rpartition(".")
        if owner and not key.startswith("hydra") and "/" not in value and name not in ("folder", "file"):
            parameters.setdefault(owner, {})[name] = value.lower() if value in ("True", "False") else value
    return {owner: [f"{name}={value}" for name, value in values.items()] for owner, values in parameters.items()}


def _named(name: str, parameters: list[str]) -> str:
    return f"{name}({', '.join(parameters)})" if parameters else name


def bare(label: str) -> str:
    """Return a label without its parameters: "bias(accel_mps2=0.1)+dropout" is bias+dropout."""
    depth, kept = 0, []
    for letter in label:
        depth += letter == "("
        if not depth:
            kept.append(letter)
        depth -= letter == ")" and depth > 0
    return "".join(kept)
