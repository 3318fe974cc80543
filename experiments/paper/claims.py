"""The paper's claims on jerk and MTF, one by one, scenario by scenario.

python experiments/paper/claims.py results/paper20     at defaults, on the rows of the comparison; prints a table
python experiments/paper/claims.py results/audit-full  tuned, on the stored rows of an audit
"""

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.campaign.answer import AUDIT_FOLDER, MIN_DRIVES, NO_FAULT, kinds_of
from jerkbench.campaign.audit import AuditRows, cubes, read_rows
from jerkbench.campaign.protocol import AuditMethod
from jerkbench.campaign.runs import FaultScenario
from jerkbench.evaluation.drives_and_tunings import crossed_intervals
from jerkbench.evaluation.intervals import student_intervals
from jerkbench.evaluation.judgement import LEVEL
from jerkbench.jobs.study import load_study

CLAIMED = AuditMethod("jerk", "mtf")
NAIVE, BASELINE = AuditMethod("baseline_untuned", "none"), AuditMethod("baseline", "none")
ROLL_RAD, PITCH_RAD = 0.0051, 0.0076
"""The paper's errors of the tilt [rad]."""
LOST_M = 1000.0
"""What the position error of a lost run counts [m]: beyond it a run is lost."""

CLAIMED_TIMES = 10.0
"""The paper: so many times smaller than the baseline's RMSE."""
CENTIMETRES_M = 0.1
"""An RMSE below this [m] is of centimetres."""

HOLDS, FAILS, OPEN = "holds", "does not hold", "open"


@dataclass(frozen=True)
class Claim:
    """A claim in every scenario that it speaks of.

    Attributes:
        name: what is claimed, in words.
        setting: how the filters were set.
        unit: of ``numbers``: "" of a ratio, "m" of an error.
        numbers: (S, 3) geometric mean over seeds, and the ends of an interval that holds for all scenarios at once.
        bound: the claim is that the number lies below it.
        scenarios: of which it speaks.
    """

    name: str
    setting: str
    unit: str
    numbers: FloatArray
    bound: float
    scenarios: tuple[FaultScenario, ...]

    @property
    def words(self) -> list[str]:
        """Whether it holds in each scenario, by the interval."""
        return [_word(low, high, self.bound) for _, low, high in self.numbers.tolist()]


def _word(low: float, high: float, bound: float) -> str:
    if high < bound:
        return HOLDS
    return FAILS if low >= bound else OPEN


def logs(rows: pd.DataFrame, method: AuditMethod, metric: str) -> pd.DataFrame:
    """Return the logarithm of a metric: a line for each scenario, a column for each seed."""
    own = rows[(rows["filter"] == method.filter) & (rows["adaptation"] == method.adaptation)]
    values = own[metric].where((own["status"] == "ok") | (metric != "position_rmse_m"), LOST_M)
    return np.log(
        own.assign(value=values).pivot_table(index=["dataset", "disturbance"], columns="seed", values="value")
    )


def claims(rows: pd.DataFrame) -> list[Claim]:
    """Return every claim in every scenario."""
    error, naive, baseline = (logs(rows, method, "position_rmse_m") for method in (CLAIMED, NAIVE, BASELINE))
    faults = error.index.get_level_values("disturbance") != "none"
    return [
        _claim(f"roll within {ROLL_RAD:g} rad", "", logs(rows, CLAIMED, "roll_rmse_rad"), ROLL_RAD, "rad"),
        _claim(f"pitch within {PITCH_RAD:g} rad", "", logs(rows, CLAIMED, "pitch_rmse_rad"), PITCH_RAD, "rad"),
        _claim(f"more than {CLAIMED_TIMES:g} times better", "naive baseline", error - naive, 1 / CLAIMED_TIMES),
        _claim(f"more than {CLAIMED_TIMES:g} times better", "baseline", error - baseline, 1 / CLAIMED_TIMES),
        _claim("an error of centimetres (below 0.1 m)", "", error, CENTIMETRES_M, "m"),
        _claim("resilient: under a fault better", "naive baseline", (error - naive)[faults], 1.0),
        _claim("resilient: under a fault better", "baseline", (error - baseline)[faults], 1.0),
    ]


def _claim(name: str, against: str, values: pd.DataFrame, bound: float, unit: str = "") -> Claim:
    scenarios = tuple(FaultScenario(field, {}, fault, {}) for field, fault in values.index)
    return Claim(name, against or "-", unit, _intervals(values.to_numpy()), bound, scenarios)


def audit_claims(rows: AuditRows) -> list[Claim]:
    """Return every claim that an audit's rows speak of, under each kind of fault; tuned, as the baseline is."""
    kinds = {kind: drives for kind, drives in kinds_of(rows).items() if drives.sum() >= MIN_DRIVES}
    error, baseline = (cubes(rows, [method]).tuned for method in (CLAIMED, BASELINE))
    faults = {kind: drives for kind, drives in kinds.items() if kind != NO_FAULT}
    return [
        _of_audit(f"more than {CLAIMED_TIMES:g} times better", "baseline", error - baseline, 1 / CLAIMED_TIMES, kinds),
        _of_audit("an error of centimetres (below 0.1 m)", "-", error, CENTIMETRES_M, kinds, "m"),
        _of_audit("resilient: under a fault better", "baseline", error - baseline, 1.0, faults),
    ]


def _of_audit(
    name: str, against: str, y: FloatArray, bound: float, kinds: Mapping[str, BoolArray], unit: str = ""
) -> Claim:
    """A claim on random drives (1, R, D); the intervals count drives and tunings."""
    ends = [crossed_intervals(y[:, :, drives], LEVEL / len(kinds))[:3] for drives in kinds.values()]
    scenarios = tuple(FaultScenario("random", {}, kind, {}) for kind in kinds)
    return Claim(name, against, unit, np.exp(np.array(ends)[:, :, 0]), bound, scenarios)


def _intervals(d: FloatArray) -> FloatArray:
    low, high = student_intervals(d, 1 - LEVEL / len(d))
    return np.asarray(np.exp(np.column_stack([d.mean(axis=1), low, high])))


def claim_table(of_paper: Sequence[Claim]) -> str:
    """Return a claim a row: in how many scenarios it holds, middle and ends of its numbers, and where it holds."""
    heads = ["the paper's claim", "against", "holds", "does not", "open", "median (range)", "where it holds"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    return "\n".join([*lines, *map(_line, of_paper)]) + "\n"


def _line(claim: Claim) -> str:
    counts = Counter(claim.words)
    middle, least, most = (float(f(claim.numbers[:, 0])) for f in (np.median, np.min, np.max))
    unit = f" {claim.unit}" if claim.unit else ""
    values = f"{middle:.2g}{unit} ({least:.2g} to {most:.2g})"
    numbers = " | ".join(f"{counts[word]} of {len(claim.words)}" for word in (HOLDS, FAILS, OPEN))
    return f"| {claim.name} | {claim.setting} | {numbers} | {values} | {where_it_holds(claim)} |"


def where_it_holds(claim: Claim) -> str:
    """Return the families in which a claim holds, with the number of their scenarios; the condition of the claim."""
    total = Counter(scenario.fault for scenario in claim.scenarios)
    held = Counter(s.fault for s, word in zip(claim.scenarios, claim.words, strict=True) if word == HOLDS)
    if held == total:
        return "everywhere"
    names = {name: name if held[name] == count else f"{name} {held[name]}/{count}" for name, count in total.items()}
    return ", ".join(text for name, text in names.items() if held[name]) or "nowhere"


def table(folder: Path) -> str:
    """Return the claims as Markdown."""
    audit = folder.name.startswith(AUDIT_FOLDER)
    return claim_table(audit_claims(read_rows(folder)) if audit else claims(load_study(folder).rows))


if __name__ == "__main__":
    print(table(Path(sys.argv[1])))
