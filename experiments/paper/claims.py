"""The paper's claims on jerk and MTF, one by one, scenario by scenario.

python experiments/paper/claims.py results/paper20     at defaults, on the rows of the comparison; prints a table
python experiments/paper/claims.py results/audit-full  at defaults and tuned, on the stored runs of an audit

Of an audit it writes claims.csv, and a section that `jerkbench audit --stored` takes along into the page.
"""

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jerkbench.audit.methods import AuditMethod
from jerkbench.audit.verdicts import DEFAULTS, TUNED, Losses

from jerkbench.arrays import FloatArray
from jerkbench.audit.page import SECTIONS
from jerkbench.audit.protocol import read_protocol
from jerkbench.audit.study import FOLDER, run_audit
from jerkbench.campaigns.protocol import FaultScenario
from jerkbench.campaigns.ratios import NOMINAL
from jerkbench.campaigns.search import levels_of
from jerkbench.evaluation.statistics.intervals import student_intervals
from jerkbench.evaluation.statistics.judgement import LEVEL
from jerkbench.files import write_text
from jerkbench.jobs.cluster import Local
from jerkbench.results.study import load_study

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

SECTION = """\
## The paper's claims

Of `jerk + mtf` against `baseline + none`, set alike, in each scenario; a claim holds where its interval, for all \
scenarios at
once, lies on its side (`claims.csv`). *defaults*: both as they come; *tuned*: both tuned, scored on faults that \
were not seen.

{table}
The claim on tilt does not depend on the filter: experiments/paper has it.
"""


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
    scenarios = tuple(FaultScenario(field, {}, fault, fault, "both", {}) for field, fault in values.index)
    return Claim(name, against or "-", unit, _intervals(values.to_numpy()), bound, scenarios)


def audit_claims(known: Losses, levels: Mapping[int, float]) -> list[Claim]:
    """Return every claim that the audit's rows speak of; none where it has not both methods.

    Args:
        known: losses of the audit.
        levels: of each scenario [m].
    """
    if not all((method, DEFAULTS, 0) in known.by_kind for method in (CLAIMED, BASELINE)):
        return []
    return [
        claim
        for kind in (DEFAULTS, TUNED)
        for claim in (_times(known, kind), _centimetres(known, kind, levels), _resilience(known, kind))
    ]


def _times(known: Losses, kind: str) -> Claim:
    """Ten times better: the ratio of the errors lies below a tenth."""
    d = known.by_kind[CLAIMED, kind, 0] - known.by_kind[BASELINE, kind, 0]
    return _of_audit(f"more than {CLAIMED_TIMES:g} times better than the baseline", kind, d, 1 / CLAIMED_TIMES, known)


def _centimetres(known: Losses, kind: str, levels: Mapping[int, float]) -> Claim:
    """An accuracy of centimetres: the error lies below 0.1 m."""
    level = np.log([levels[number] for number in range(len(known.scenarios))])
    d = known.by_kind[CLAIMED, kind, 0] + level[:, None]
    return _of_audit("an error of centimetres (below 0.1 m)", kind, d, CENTIMETRES_M, known, "m")


def _resilience(known: Losses, kind: str) -> Claim:
    """Resilient to disturbance: its error under a fault is the smaller one."""
    d = known.by_kind[CLAIMED, kind, 0] - known.by_kind[BASELINE, kind, 0]
    faults = [k for k, scenario in enumerate(known.scenarios) if scenario.family != NOMINAL]
    only = tuple(known.scenarios[k] for k in faults)
    return Claim("resilient: under a fault better than the baseline", kind, "", _intervals(d[faults]), 1.0, only)


def _of_audit(name: str, kind: str, d: FloatArray, bound: float, known: Losses, unit: str = "") -> Claim:
    return Claim(name, kind, unit, _intervals(d), bound, tuple(known.scenarios))


def _intervals(d: FloatArray) -> FloatArray:
    low, high = student_intervals(d, 1 - LEVEL / len(d))
    return np.asarray(np.exp(np.column_stack([d.mean(axis=1), low, high])))


def claim_frame(of_paper: Sequence[Claim]) -> pd.DataFrame:
    """Return the value of every claim in every scenario, one a row."""
    return pd.DataFrame(
        [
            {
                "claim": claim.name,
                "setting": claim.setting,
                "scenario": scenario.name,
                "value": value,
                "low": low,
                "high": high,
                "bound": claim.bound,
                "verdict": word,
            }
            for claim in of_paper
            for scenario, (value, low, high), word in zip(claim.scenarios, claim.numbers, claim.words, strict=True)
        ]
    )


def claim_table(of_paper: Sequence[Claim]) -> str:
    """Return a claim a row: in how many scenarios it holds, middle and ends of its numbers, and where it holds."""
    heads = ["the paper's claim", "set", "holds", "does not", "open", "median (range)", "where it holds"]
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
    total = Counter(scenario.family for scenario in claim.scenarios)
    held = Counter(s.family for s, word in zip(claim.scenarios, claim.words, strict=True) if word == HOLDS)
    if held == total:
        return "everywhere"
    names = {name: name if held[name] == count else f"{name} {held[name]}/{count}" for name, count in total.items()}
    return ", ".join(text for name, text in names.items() if held[name]) or "nowhere"


def table(folder: Path) -> str:
    """Return the claims as Markdown."""
    return claim_table(claims(load_study(folder).rows)).replace("| set |", "| against |")


def write_claims(folder: Path) -> None:
    """Write the claims of an audit whose runs are stored: a table, and a section for its page."""
    audit = run_audit(read_protocol(folder.name.removeprefix(FOLDER)), folder, Local(), 1, only_stored=True)
    found = audit_claims(audit.losses, levels_of(audit.outcome.test, audit.protocol.plain))
    write_text(folder / "claims.csv", claim_frame(found).to_csv(index=False))
    if found:
        write_text(folder / SECTIONS / "1_claims.md", SECTION.format(table=claim_table(found)))


if __name__ == "__main__":
    if (results := Path(sys.argv[1])).name.startswith(FOLDER):
        write_claims(results)
    else:
        print(table(results))
