"""Prints the tables of the study's page from its rows.

python experiments/replayed/summary.py results/replayed
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.evaluation.intervals import Centre, Samples, centres
from jerkbench.evaluation.judgement import Verdict
from jerkbench.jobs.study import load_study
from jerkbench.report.comparisons import Comparison
from jerkbench.report.findings import study_verdicts
from jerkbench.report.table_model import number

METRIC = "position_rmse_m"
SHOWN = "jerk"
"""The filter of the table of errors."""

MARKS = {
    Verdict.BETTER: "+",
    Verdict.FEWER_FAILED: "+",
    Verdict.EQUAL: "=",
    Verdict.SMALL: "~",
    Verdict.WORSE: "-",
    Verdict.MORE_FAILED: "-",
    Verdict.UNDECIDED: "?",
}
PLACES = {"field": "the field", "rtklib": "the drive"}

Key = tuple[str, str, str, str]
"""Data set, disturbance, filter, adaptation."""


def losses(rows: pd.DataFrame) -> dict[Key, np.ndarray]:
    """Return the position RMSE [m] of the starts of each cell; a lost run, or one without a number, is infinite."""
    values = rows[METRIC].where(rows["status"] == "ok", np.inf).fillna(np.inf)
    groups = values.groupby([rows[key] for key in ("dataset", "disturbance", "filter", "adaptation")], sort=False)
    return {key: group.to_numpy(dtype=float) for key, group in groups}


def scenarios(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Return data set and disturbance of each scenario, in the order of the rows."""
    pairs = rows[["dataset", "disturbance"]].drop_duplicates().itertuples(index=False, name=None)
    return sorted(pairs, key=lambda pair: pair[0])


def title(scenario: tuple[str, str]) -> str:
    """Return the scenario's column."""
    trace = scenario[1].partition("trace=")[2].rstrip(")")
    return f"{PLACES[scenario[0].partition('(')[0]]}, {trace}"


def adaptations(rows: pd.DataFrame) -> list[str]:
    """Return the adaptations in the order of the rows."""
    return list(dict.fromkeys(rows["adaptation"]))


def cell_text(centre: Centre, errors: np.ndarray) -> str:
    """Return the centre with what was lost and locked out: "lost" where half of the starts or more were."""
    lost = int(np.isinf(errors).sum())
    troubles = [f"{count}/{len(errors)} {word}" for count, word in ((lost, "lost"), (centre.outlying, "out")) if count]
    shown = [number(centre.value)] if np.isfinite(centre.value) else []
    return "; ".join([*shown, *troubles])


def table(head: str, rows: Mapping[str, list[str]], columns: list[str]) -> Iterator[str]:
    """Yield the lines of a table."""
    yield f"| {head} | " + " | ".join(columns) + " |"
    yield "|---" * (len(columns) + 1) + "|"
    for name, cells in rows.items():
        yield f"| {name} | " + " | ".join(cells) + " |"


def errors_table(rows: pd.DataFrame, factor: str, **fixed: str) -> Iterator[str]:
    """Yield position RMSE of each value of ``factor`` in each scenario, the other factor being ``fixed``."""
    known = losses(rows)
    stand = dict(zip(known, centres(Samples.of(list(known.values()))), strict=True))
    own: dict[str, list[str]] = {}
    for name in dict.fromkeys(rows[factor]):
        method = {**fixed, factor: name}
        keys = [(*at, method["filter"], method["adaptation"]) for at in scenarios(rows)]
        if any(key in known for key in keys):
            own[name] = [cell_text(stand[key], known[key]) if key in known else "" for key in keys]
    yield from table(factor, own, [title(at) for at in scenarios(rows)])


def against_none(rows: pd.DataFrame) -> dict[str, dict[tuple[str, str], dict[str, Comparison]]]:
    """Return each adaptation against none: by adaptation, scenario and filter; all of them are one family."""
    by_adaptation: dict[str, dict[tuple[str, str], dict[str, Comparison]]] = {}
    for comparison in study_verdicts(rows, METRIC, most=0).against({"adaptation": "none"}):
        values = comparison.subject._asdict()
        at = values["dataset"], values["disturbance"]
        by_adaptation.setdefault(values["adaptation"], {}).setdefault(at, {})[values["filter"]] = comparison
    return by_adaptation


def marks(comparisons: Mapping[str, Comparison], filters: list[str]) -> str:
    """Return a mark for each filter: "." where it does not take the adaptation."""
    return "".join(MARKS[comparisons[name].verdict] if name in comparisons else "." for name in filters)


def verdicts_table(rows: pd.DataFrame) -> Iterator[str]:
    """Yield what was shown of each adaptation against none, a mark for each filter."""
    filters = [name for name in dict.fromkeys(rows["filter"]) if name != "gnss_only"]
    own = {
        name: [f"`{marks(cells.get(at, {}), filters)}`" for at in scenarios(rows)]
        for name, cells in against_none(rows).items()
    }
    yield from table(f"adaptation ({', '.join(filters)})", own, [title(at) for at in scenarios(rows)])


def named(words: list[str]) -> str:
    """Return the words with commas, or "-"."""
    return ", ".join(words) or "-"


SUMMARY = ("better with some filters, worse with no filter", "worse with every filter", "diverged or failed runs")
"""Columns of the last table."""


def summary_table(rows: pd.DataFrame) -> Iterator[str]:
    """Yield a summary of the comparisons with no adaptation, with a line for each scenario."""
    shown, known = against_none(rows), losses(rows)
    lines: dict[str, list[str]] = {}
    for at in scenarios(rows):
        rivals = {
            name: [MARKS[comparison.verdict] for comparison in cells[at].values()]
            for name, cells in shown.items()
            if at in cells and name != "oracle"
        }
        helps = [name for name, marks in rivals.items() if "+" in marks and "-" not in marks]
        harms = [name for name, marks in rivals.items() if set(marks) == {"-"}]
        lost: dict[str, int] = {}
        for key, errors in known.items():
            if key[:2] == at and np.isinf(errors).any():
                lost[key[2]] = lost.get(key[2], 0) + int(np.isinf(errors).sum())
        counts = [f"{count} with {name}" for name, count in lost.items()]
        lines[title(at)] = [named(helps), named(harms), named(counts)]
    yield from table("scenario", lines, list(SUMMARY))


def main(folder: Path) -> None:
    """Print the tables."""
    rows = load_study(folder).rows
    print("\n".join(errors_table(rows, "filter", adaptation="none")), end="\n\n")
    print("\n".join(errors_table(rows, "adaptation", filter=SHOWN)), end="\n\n")
    print("\n".join(verdicts_table(rows)), end="\n\n")
    print("\n".join(summary_table(rows)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
