"""The two tables of the study's page: the jerk filter in each scenario, and each adaptation against none.

python experiments/filters/verdicts.py results/filters
"""

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.evaluation.intervals import Centre, Samples, centres
from jerkbench.evaluation.judgement import Verdict
from jerkbench.jobs.study import load_study
from jerkbench.report.findings import study_verdicts
from jerkbench.report.table_model import number

METRIC = "position_rmse_m"
REFERENCES = ("none", "oracle")
SCENARIO = ["dataset", "disturbance"]
KINDS = tuple(Verdict)


def centres_of(rows: pd.DataFrame) -> dict[tuple[str, ...], Centre]:
    """Return the centre of the errors (`centres`) of each scenario, filter and adaptation."""
    values = rows[METRIC].where(rows["status"] == "ok", np.inf)
    groups = values.groupby([rows[key] for key in (*SCENARIO, "filter", "adaptation")], sort=False)
    samples = {key: group.to_numpy(dtype=float) for key, group in groups}
    return dict(zip(samples, centres(Samples.of(list(samples.values()))), strict=True))


def of_jerk(rows: pd.DataFrame) -> Iterator[str]:
    """Yield a line for each scenario: none, mtf, the lowest adaptation and the oracle, all with jerk."""
    known = centres_of(rows)
    for at in rows[SCENARIO].drop_duplicates().itertuples(index=False, name=None):
        own = {key[3]: centre.value for key, centre in known.items() if key[:3] == (*at, "jerk")}
        value, name = min((value, name) for name, value in own.items() if name not in REFERENCES)
        shown = [number(own["none"]), number(own["mtf"]), f"{number(value)} ({name})", number(own["oracle"])]
        yield f"| {' '.join(at)} | " + " | ".join(shown) + " |"


def against_none(rows: pd.DataFrame) -> Iterator[str]:
    """Yield a line for each adaptation with jerk: in how many scenarios it is what against none, all one family."""
    verdicts = study_verdicts(rows[rows["filter"] == "jerk"], METRIC).against({"adaptation": "none"})
    counts: dict[str, Counter[Verdict]] = {}
    for comparison in verdicts:
        name = comparison.subject.adaptation
        counts.setdefault(name, Counter())[comparison.verdict] += 1
    for name, own in counts.items():
        yield f"| {name} | " + " | ".join(str(own[kind]) for kind in KINDS) + " |"


def main(folder: Path) -> None:
    """Print both tables."""
    rows = load_study(folder).rows
    print("| scenario | none | mtf | lowest of all adaptations | oracle |\n|---|---|---|---|---|")
    print("\n".join(of_jerk(rows)))
    print("\n| jerk with | " + " | ".join(kind.value for kind in KINDS) + " |\n|---" + "|---" * len(KINDS) + "|")
    print("\n".join(against_none(rows)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
