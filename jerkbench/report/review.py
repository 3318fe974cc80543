"""Questions that a reviewer would have about a study, and answers computed from the rows and configurations."""

import json
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from jerkbench.evaluation.metrics.consistency import EXPECTED_ANEES
from jerkbench.report.columns import FACTORS, METHOD, SCENARIO_FACTORS, competes, with_metric
from jerkbench.report.labels import REUSED, TUNED_SUFFIX
from jerkbench.report.table_model import arranged, range_text

if TYPE_CHECKING:
    import pandas as pd


_MIN_SEEDS = 10
"""With fewer seeds, large differences are often not significant."""

MIN_SETTINGS = 3
"""Minimum number of settings in a sweep of a parameter."""

_CREDIBLE = 0.5, 2.0
"""Range in which the ratio of the ANEES to its expected value is accepted as approximately consistent."""

REPLACED = re.compile(r"(position|velocity|course|wheel)_(?:sigma|variance|covariance)_[a-z0-9]+")
"""Matches the names of parameters of a data set or a filter that replace the accuracy reported by the receiver."""

REPORTED = ("sigma", "variance", "covariance")
"""Last parts of the names of parameters that select a column with the reported accuracy.

If such a parameter is set, the reported accuracy is not replaced.
"""

TUNED = "Tuned by jerkbench tune: "
"""Start of the note that tuned presets add to their runs. The tuning budget follows."""

ReviewedCells = Sequence[Mapping[str, Any]]


class Check(NamedTuple):
    """One question that a reviewer would have, with its answer.

    Attributes:
        question: text of the question.
        passed: True if the study passes the check, False if the study fails, or None if the question does not apply.
        reason: text that explains the answer.
    """

    question: str
    passed: bool | None
    reason: str


def review(rows: "pd.DataFrame", cells: ReviewedCells, metric: str) -> list[Check]:
    """Return all questions of the review, with the answers for a study.

    Args:
        rows: one row for each job and seed.
        cells: metadata of each job: labels, spec, protocol, data, notes.
        metric: main metric of the study.
    """
    answers = {
        "Is the covariance of the receiver used?": _covariance(cells),
        "Were the baselines tuned with the same budget?": _budget(cells),
        "Is there more than one recording?": _recordings(cells),
        "Are there enough seeds?": _seeds(rows, cells),
        "Are the best filters approximately consistent?": _consistency(rows, metric),
        "Is the reference independent of the measurements?": _independence(cells),
    }
    return [Check(question, *answer) for question, answer in answers.items()]


Answered = tuple[bool | None, str]
"""The values of `Check.passed` and `Check.reason`."""


def _covariance(cells: ReviewedCells) -> Answered:
    real = [cell["spec"] for cell in cells if cell["data"]]
    if not real:
        return None, "All recordings are simulated: the reported covariance is the covariance of the noise."
    replaced = sorted({name for spec in real for kind in ("dataset", "filter") for name in _replaced(spec[kind])})
    if replaced:
        return False, f"Replaced by parameters: {', '.join(replaced)}."
    return True, "The filters get R as the recordings report it."


def _replaced(part: Mapping[str, Any]) -> list[str]:
    """Return the names of parameters that replace an accuracy that the receiver reports."""
    replaced = []
    for key, value in part.items():
        match = REPLACED.fullmatch(key)
        if match is None or value in (None, [], ()) or part.get(f"{match[1]}_file") == "":
            continue
        if not any(part.get(f"{match[1]}_{end}") for end in REPORTED):
            replaced.append(f"{part['name']}.{key}")
    return replaced


def _budget(cells: ReviewedCells) -> Answered:
    """Check that all methods were tuned with the same budget, or ran with the same number of parameter settings."""
    settings: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    notes: dict[str, set[str]] = defaultdict(set)
    labelled = any(cell["labels"]["filter"].endswith(TUNED_SUFFIX) for cell in cells)
    for cell in cells:
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
    text = ", ".join(f"{method} {range_text(of)}" for method, of in counts.items())
    return passed, f"Settings of each method: {text}. Required: the same number for all, and at least {MIN_SETTINGS}."


def _method(cell: Mapping[str, Any]) -> str:
    return " + ".join(cell["spec"][kind]["name"] for kind in ("filter", "adaptation"))


def _scenario(cell: Mapping[str, Any]) -> str:
    return json.dumps([cell["spec"]["dataset"], cell["data"], cell["labels"]["disturbance"]], sort_keys=True)


def _recordings(cells: ReviewedCells) -> Answered:
    """Check that each method ran on at least two recordings. Recordings with equal data count as one recording."""
    names = sorted({cell["labels"]["dataset"] for cell in cells})
    runs: dict[str, set[str]] = defaultdict(set)
    for cell in cells:
        runs[_method(cell)].add(cell["data"] or f"simulated {cell['spec']['dataset']['name']}")
    different = {recording for recordings in runs.values() for recording in recordings}
    once = sorted(method for method, recordings in runs.items() if len(recordings) < 2)
    real = sum(not recording.startswith("simulated ") for recording in different)
    text = f"{len(different)} recording{'s' * (len(different) > 1)}, {real} of them real: {', '.join(names)}."
    if len(different) > 1 and once:
        text += f" Only on one recording: {', '.join(once)}."
    return not once, text


def _seeds(rows: "pd.DataFrame", cells: ReviewedCells) -> Answered:
    """Check that each combination has enough successful seeds that no tuning used, the same for all its methods."""
    seeded = rows[rows["replicate"] == "seed"]
    # A row without a seed is a phase of a recording, or the single run of a combination without random parts.
    per_cell = rows[rows["replicate"] == "phase"].groupby([*FACTORS]).size()
    phases, single = int(per_cell[per_cell > 1].sum()), int((per_cell == 1).sum())
    more = f" {single} rows are the one run of a recording in which nothing is random." if single else ""
    more += f" {phases} rows are phases of recordings, which are not independent." if phases else ""
    if len(seeded) == 0:
        return False, f"No seeds:{more}"
    well = (seeded["status"] == "ok").groupby([seeded[key] for key in FACTORS]).sum()
    drawn = seeded.groupby([*FACTORS])["seed"].agg(lambda seeds: str(sorted(seeds)))
    same = drawn.groupby(level=["dataset", "disturbance", "attitude"]).nunique().max() == 1
    other = "" if same else " Combinations of one scenario have different seeds."
    reused = [f" {note}" for cell in cells for note in cell["notes"] if note.startswith(REUSED)][:1]
    passed = bool(well.min() >= _MIN_SEEDS and not more and same and not reused)
    required = f"{range_text(well)} successful seeds for each combination; required: {_MIN_SEEDS}."
    return passed, "".join([required, other, more, *reused])


def _consistency(rows: "pd.DataFrame", metric: str) -> Answered:
    if "anees" not in rows or rows["anees"].isna().all():
        return False, "NEES was not computed, or no reference allows it."
    grid = arranged(with_metric(rows, metric), SCENARIO_FACTORS, METHOD)
    good = [
        (cell.mean, combination)
        for combination, cell in grid.cells(metric).items()
        if cell.complete and competes(dict(zip(FACTORS, combination, strict=True)))
    ]
    best = {combination[:3]: combination for _, combination in sorted(good, reverse=True)}  # the lowest error is last
    scenarios = len(grid.row_values)
    if len(best) < scenarios:
        return False, f"On {scenarios - len(best)} of {scenarios} scenarios every method has failed runs."
    anees = grid.cells("anees")
    ratios = [anees[combination].mean / EXPECTED_ANEES for combination in best.values()]
    wrong = sum(not _CREDIBLE[0] <= ratio <= _CREDIBLE[1] for ratio in ratios)
    value = f"{min(ratios):.2g} to {max(ratios):.2g} times the expected value {EXPECTED_ANEES:g}"
    found = f"The ANEES of the best method of each scenario is {value}. Accepted: {_CREDIBLE[0]:g} to {_CREDIBLE[1]:g}."
    return not wrong, found + f" Not accepted in {wrong} of {scenarios} scenarios." * bool(wrong)


def _independence(cells: ReviewedCells) -> Answered:
    """Check that the source of the reference of each data set is stated, and is independent of the measurements."""
    notes: dict[str, dict[str, None]] = defaultdict(dict)
    for cell in cells:
        found = [note for note in cell["notes"] if note.startswith("Reference of ")]
        notes[cell["labels"]["dataset"]].update(dict.fromkeys(found))
    silent = [name for name, found in notes.items() if not found]
    text = list(dict.fromkeys(note for found in notes.values() for note in found))
    if silent:
        text.append(f"The source of the reference is not stated: {', '.join(silent)}.")
    return not silent and not any("not independent of" in note for note in text), " ".join(text)
