"""A reviewer's questions about a comparison, answered from its rows and configurations."""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jerkbench.evaluation.consistency_verdict import NEAR
from jerkbench.report.columns import FACTORS, competes
from jerkbench.report.labels import TUNED_SUFFIX
from jerkbench.report.summary import summarise
from jerkbench.report.sweeps import costs

if TYPE_CHECKING:
    import pandas as pd


_MIN_SEEDS = 10
"""Fewer leave large differences unshown."""

MIN_SETTINGS = 3
"""Fewer settings are no sweep."""

BELIEVED = (
    f"From {NEAR[0]:g} to {NEAR[1]:g} times is near enough to be believed; "
    "the column 'NEES says' is stricter: there any deviation that the seeds show counts."
)
"""What the answer about consistency asks, and what the table of cells does."""

REPLACED = re.compile(r"(\w+)_(?:sigma|variance|covariance)_[a-z0-9]+")
"""Parameters of a real data set, or of a filter, that replace what the receiver says of its accuracy."""

REPORTED = ("sigma", "variance", "covariance")
"""Ends of the parameters that say where the log has the receiver's own; with one of them nothing is replaced."""

_STREAMS = ("position", "velocity", "course", "wheel")
"""Measurements that have an accuracy of their own."""

TUNED = "Tuned by jerkbench tune: "
"""The note that the presets of a tuning give to their runs starts with this; the budget follows."""

ReviewedCells = Sequence[Mapping[str, Any]]


class Check(NamedTuple):
    """One question of a reviewer.

    Attributes:
        question: as a reviewer puts it.
        passed: whether the study answers it; None: it does not arise.
        reason: what in the rows says so.
    """

    question: str
    passed: bool | None
    reason: str


class Evidence(NamedTuple):
    """What there is to judge by.

    Attributes:
        rows: one row a cell and seed.
        cells: of each cell what is stored beside its rows: labels, spec, protocol, data, notes.
        metric: the leading metric.
    """

    rows: "pd.DataFrame"
    cells: ReviewedCells
    metric: str


def review(evidence: Evidence) -> list[Check]:
    """Return every question with its answer."""
    questions: dict[str, Callable[[Evidence], tuple[bool | None, str]]] = {
        "Is the receiver's own covariance used?": _covariance,
        "Were the baselines tuned with the same budget?": _budget,
        "Is there more than one recording?": _recordings,
        "Are there enough seeds?": _seeds,
        "Has every mean an interval?": _intervals,
        "Are the best filters near enough to consistent?": _consistency,
        "Is the reference independent of the measurements?": _independence,
        "Are window sizes justified by a sweep?": _windows,
    }
    return [Check(question, *answer(evidence)) for question, answer in questions.items()]


def _covariance(evidence: Evidence) -> tuple[bool | None, str]:
    real = [cell["spec"] for cell in evidence.cells if cell["data"]]
    if not real:
        return None, "Every recording is simulated: the covariance that is reported is that of the noise."
    replaced = sorted({name for spec in real for kind in ("dataset", "filter") for name in _replaced(spec[kind])})
    if replaced:
        return False, f"Replaced by parameters: {', '.join(replaced)}."
    return True, "The filters get R as the recordings report it."


def _replaced(part: Mapping[str, Any]) -> list[str]:
    """The parameters that stand in the place of a reported accuracy."""
    replaced = []
    for key, value in part.items():
        match = REPLACED.fullmatch(key)
        if match is None or match[1] not in _STREAMS or value in (None, [], ()):
            continue
        if not any(part.get(f"{match[1]}_{end}") for end in REPORTED):
            replaced.append(f"{part['name']}.{key}")
    return replaced


def _budget(evidence: Evidence) -> tuple[bool | None, str]:
    """Whether each method was tuned before with the same budget, or has as many settings here in each scenario."""
    settings: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    notes: dict[str, set[str]] = defaultdict(set)
    labelled = any(cell["labels"]["filter"].endswith(TUNED_SUFFIX) for cell in evidence.cells)
    for cell in evidence.cells:
        parts = [cell["spec"][kind] for kind in ("attitude", "filter", "adaptation")]
        if competes(cell["labels"]) and max(map(len, parts[1:])) > 1:
            settings[_method(cell)][_scenario(cell)].add(json.dumps(parts, sort_keys=True))
            label = " + ".join(cell["labels"][kind] for kind in ("filter", "adaptation"))
            tuned = cell["labels"]["filter"].endswith(TUNED_SUFFIX) or not labelled
            notes[label].update([note for note in cell["notes"] if note.startswith(TUNED) and tuned] or [""])
    counts = {method: sorted({len(of) for of in tried.values()}) for method, tried in sorted(settings.items())}
    if not counts:
        return None, "No method has a parameter."
    if budgets := sorted(set[str]().union(*notes.values()) - {""}):
        tuned_names = {label.replace(TUNED_SUFFIX, "") for label in notes if TUNED_SUFFIX in label}
        untuned = ", ".join(method for method, of in notes.items() if "" in of and method not in tuned_names)
        return len(budgets) == 1 and not untuned, " ".join(budgets) + f" Not tuned: {untuned}." * bool(untuned)
    passed = len({count for of in counts.values() for count in of}) == 1 and min(counts.values())[0] >= MIN_SETTINGS
    told = ", ".join(
        f"{method} {' to '.join(map(str, dict.fromkeys((of[0], of[-1]))))}" for method, of in counts.items()
    )
    return passed, f"Settings of each method: {told}; as many of each, and at least {MIN_SETTINGS}, are asked for."


def _method(cell: Mapping[str, Any]) -> str:
    return " + ".join(cell["spec"][kind]["name"] for kind in ("filter", "adaptation"))


def _scenario(cell: Mapping[str, Any]) -> str:
    return json.dumps([cell["spec"]["dataset"], cell["data"], cell["labels"]["disturbance"]], sort_keys=True)


def _recordings(evidence: Evidence) -> tuple[bool | None, str]:
    """Whether each method ran on several recordings: other data, or another simulation, not another name."""
    names = sorted({cell["labels"]["dataset"] for cell in evidence.cells})
    runs: dict[str, set[str]] = defaultdict(set)
    for cell in evidence.cells:
        runs[_method(cell)].add(cell["data"] or f"simulated {cell['spec']['dataset']['name']}")
    different = {recording for recordings in runs.values() for recording in recordings}
    once = sorted(method for method, recordings in runs.items() if len(recordings) < 2)
    real = sum(not recording.startswith("simulated ") for recording in different)
    told = f"{len(different)}, of which {real} are real: {', '.join(names)}."
    if len(different) > 1 and once:
        told += f" On one only: {', '.join(once)}."
    return not once, told


def _seeds(evidence: Evidence) -> tuple[bool | None, str]:
    """Whether enough seeds went well in each cell, and the methods of a scenario have the same."""
    rows = evidence.rows
    seeded = rows[rows["replicate"] == "seed"]
    # beside seeds: phases of recordings, and single runs in which nothing is random
    per_cell = rows[rows["replicate"] == "phase"].groupby([*FACTORS]).size()
    phases, single = int(per_cell[per_cell > 1].sum()), int((per_cell == 1).sum())
    more = f" {single} rows are the one run of a recording in which nothing is random." if single else ""
    more += f" {phases} rows are phases of recordings, which are not independent." if phases else ""
    if len(seeded) == 0:
        return False, f"None:{more}"
    well = (seeded["status"] == "ok").groupby([seeded[key] for key in FACTORS]).sum()
    counted = f"{well.min()}" if well.min() == well.max() else f"{well.min()} to {well.max()}"
    drawn = seeded.groupby([*FACTORS])["seed"].agg(lambda seeds: str(sorted(seeds)))
    alike = drawn.groupby(level=["dataset", "disturbance", "attitude"]).nunique().max() == 1
    other = "" if alike else " Combinations of one scenario have different seeds."
    passed = bool(well.min() >= _MIN_SEEDS and not more and alike)
    return passed, f"{counted} a cell that went well; {_MIN_SEEDS} are asked for.{other}{more}"


def _intervals(evidence: Evidence) -> tuple[bool | None, str]:
    cells = [cell for row in summarise(evidence.rows, evidence.metric, leaders=False).cells for cell in row if cell]
    without = sum(not (cell.replicate == "seed" and np.isfinite(cell.low)) for cell in cells)
    partial = sum(not cell.complete for cell in cells)
    survivors = f" {partial} are over a part of the runs, or of none." if partial else ""
    return without + partial == 0, f"{len(cells) - without} of {len(cells)} means have one.{survivors}"


def _consistency(evidence: Evidence) -> tuple[bool | None, str]:
    if "anees" not in evidence.rows or evidence.rows["anees"].isna().all():
        return False, "NEES was not computed, or no reference allows it."
    found = costs(evidence.rows, evidence.metric)
    scenarios, methods = found.scenarios, found.methods
    values = np.where(np.isfinite(found.means) & found.rivals, found.means, np.inf)
    lost = [name for name, row in zip(scenarios, values, strict=True) if np.isinf(row).all()]
    if lost:
        return False, f"No method came through on {len(lost)} of {len(scenarios)} scenarios: {'; '.join(lost[:3])}."
    best = np.argmin(values, axis=1)
    ratios = costs(evidence.rows, "anees").means[np.arange(len(best)), best] / 6
    wrong = [
        f"{methods[s]} on {scenarios[p]} ({ratios[p]:.2g} times what it should be)"
        for p, s in enumerate(best)
        if not NEAR[0] <= ratios[p] <= NEAR[1]
    ]
    if wrong:
        return False, f"ANEES of the best of {len(wrong)} of {len(best)} scenarios: {'; '.join(wrong[:3])}. {BELIEVED}"
    seen = f"The ANEES of the best of each scenario is {ratios.min():.2g} to {ratios.max():.2g} times 6"
    return True, f"{seen}. {BELIEVED}"


def _independence(evidence: Evidence) -> tuple[bool | None, str]:
    """Whether each data set says where its reference comes from, and that it is independent."""
    notes: dict[str, dict[str, None]] = defaultdict(dict)
    for cell in evidence.cells:
        own = [note for note in cell["notes"] if note.startswith("Reference of ")]
        notes[cell["labels"]["dataset"]].update(dict.fromkeys(own))
    silent = [name for name, own in notes.items() if not own]
    told = list(dict.fromkeys(note for own in notes.values() for note in own))
    if silent:
        told.append(f"Nothing says where the reference comes from: {', '.join(silent)}.")
    return not silent and not any("not independent of" in note for note in told), " ".join(told)


def _windows(evidence: Evidence) -> tuple[bool | None, str]:
    """Whether each window was swept with each filter that it is used with."""
    windows: dict[tuple[str, str], set[str]] = defaultdict(set)
    for cell in evidence.cells:
        for kind in ("adaptation", "attitude", "filter"):
            part = cell["spec"][kind]
            for key in part:
                if "window" in key and part.get("adapt") != "none":
                    windows[f"{kind} {part['name']}.{key}", cell["spec"]["filter"]["name"]].add(str(part[key]))
    if not windows:
        return None, "Nothing here has a window."
    fixed = [f"{name} with {of}" for (name, of), values in sorted(windows.items()) if len(values) < MIN_SETTINGS]
    return not fixed, f"Not swept in this study: {', '.join(fixed)}." if fixed else "Each was swept in this study."
