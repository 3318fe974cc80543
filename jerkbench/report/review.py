"""What a reviewer asks of a comparison, answered from its rows and configurations."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.evaluation.statistics.consistency import NEAR
from jerkbench.report.costs import costs
from jerkbench.report.summary import summarise

if TYPE_CHECKING:
    import pandas as pd

LEAST_SEEDS = 10
"""Fewer leave large differences unshown."""

LEAST_SETTINGS = 3
"""Fewer settings are no sweep."""

BELIEVED = (
    f"From {NEAR[0]:g} to {NEAR[1]:g} times is near enough to be believed; "
    "the column 'NEES says' is stricter: there any deviation that the seeds show counts."
)
"""What the answer about consistency asks, and what the table of cells does."""

REPLACED = re.compile("sigma|covariance|variance")
"""Parameters of a real data set that replace what the receiver says of its accuracy."""


@dataclass(frozen=True)
class Check:
    """One question of a reviewer.

    Attributes:
        question: as a reviewer puts it.
        passed: whether the study answers it; None: it does not arise.
        reason: what in the rows says so.
    """

    question: str
    passed: bool | None
    reason: str


@dataclass(frozen=True, eq=False)
class Evidence:
    """What there is to judge by.

    Attributes:
        rows: one row a cell and seed.
        cells: of each cell what is stored beside its rows: labels, spec, protocol, data, notes.
        metric: the leading metric.
    """

    rows: "pd.DataFrame"
    cells: Sequence[Mapping[str, Any]]
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
    real = [cell["spec"]["dataset"] for cell in evidence.cells if cell["data"]]
    if not real:
        return None, "Every recording is simulated: the covariance that is reported is that of the noise."
    replaced = sorted(
        {f"{one['name']}.{key}" for one in real for key in one if REPLACED.search(key) and one[key] is not None}
    )
    if replaced:
        return False, f"The data sets have parameters for it: {', '.join(replaced)}."
    return True, "The filters get R as the recordings report it."


def _budget(evidence: Evidence) -> tuple[bool | None, str]:
    settings: dict[str, set[str]] = {}
    for cell in evidence.cells:
        one = cell["spec"]["filter"]
        if len(one) > 1:
            settings.setdefault(one["name"], set()).add(json.dumps(one, sort_keys=True))
    counts = {name: len(found) for name, found in sorted(settings.items())}
    said = ", ".join(f"{name} {count}" for name, count in counts.items())
    if not counts:
        return None, "No filter has a parameter."
    passed = len(set(counts.values())) == 1 and min(counts.values()) >= LEAST_SETTINGS
    return (
        passed,
        f"Settings of each filter: {said}; as many of each, and at least {LEAST_SETTINGS}, are asked for.",
    )


def _recordings(evidence: Evidence) -> tuple[bool | None, str]:
    names = sorted({cell["labels"]["dataset"] for cell in evidence.cells})
    return len(names) > 1, f"{len(names)}: {', '.join(names)}."


def _seeds(evidence: Evidence) -> tuple[bool | None, str]:
    rows = evidence.rows
    keys = ["dataset", "disturbance", "attitude", "filter", "adaptation", "noise"]
    runs = rows[rows["replicate"] == "seed"].groupby(keys).size()
    per_cell = rows[rows["replicate"] == "phase"].groupby(keys).size()
    phases, single = int(per_cell[per_cell > 1].sum()), int((per_cell == 1).sum())
    said = [f"{single} rows are the one run of a recording in which nothing is random."] if single else []
    said += [f"{phases} rows are phases of recordings, which are not independent."] if phases else []
    if len(runs) == 0:
        return False, f"None: {' '.join(said)}"
    few = int((runs < LEAST_SEEDS).sum())
    counted = f"{runs.min()}" if runs.min() == runs.max() else f"{runs.min()} to {runs.max()}"
    return few == 0 and not said, " ".join([f"{counted} a cell; {LEAST_SEEDS} are asked for.", *said])


def _intervals(evidence: Evidence) -> tuple[bool | None, str]:
    cells = [cell for row in summarise(evidence.rows, evidence.metric).cells for cell in row if cell and cell.number]
    without = sum(not (cell.replicate == "seed" and np.isfinite(cell.low)) for cell in cells)
    return without == 0, f"{len(cells) - without} of {len(cells)} means have one."


def _consistency(evidence: Evidence) -> tuple[bool | None, str]:
    if "anees" not in evidence.rows or evidence.rows["anees"].isna().all():
        return False, "NEES was not computed, or no reference allows it."
    values, scenarios, methods = costs(evidence.rows, evidence.metric)
    nees, _, _ = costs(evidence.rows, "anees")
    best = np.argmin(np.where(np.isfinite(values), values, np.inf), axis=1)
    ratios = nees[np.arange(len(best)), best] / 6
    wrong = [
        f"{methods[s]} on {scenarios[p]} ({ratios[p]:.2g} times what it should be)"
        for p, s in enumerate(best)
        if not NEAR[0] <= ratios[p] <= NEAR[1]
    ]
    if wrong:
        return False, f"ANEES of the best of {len(wrong)} of {len(best)} scenarios: {'; '.join(wrong[:3])}. {BELIEVED}"
    found = f"The ANEES of the best of each scenario is {ratios.min():.2g} to {ratios.max():.2g} times 6"
    return True, f"{found}. {BELIEVED}"


def _independence(evidence: Evidence) -> tuple[bool | None, str]:
    notes = dict.fromkeys(note for cell in evidence.cells for note in cell["notes"] if note.startswith("Reference of "))
    if not notes:
        return False, "No recording says where its reference comes from."
    return not any("not independent of" in note for note in notes), " ".join(notes)


def _windows(evidence: Evidence) -> tuple[bool | None, str]:
    windows: dict[str, set[str]] = {}
    for cell in evidence.cells:
        for kind in ("adaptation", "attitude"):
            one = cell["spec"][kind]
            for key in one:
                if "window" in key:
                    windows.setdefault(f"{kind} {one['name']}.{key}", set()).add(str(one[key]))
    if not windows:
        return None, "Nothing here has a window."
    fixed = [name for name, values in sorted(windows.items()) if len(values) < LEAST_SETTINGS]
    return not fixed, f"Not swept in this study: {', '.join(fixed)}." if fixed else "Each was swept in this study."
