"""The sentences of the study's page from its rows: where each adaptation wins and harms, and what is left to gain.

python experiments/filters/summary.py results/filters
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.evaluation.intervals import Samples, mean_intervals, student_intervals

METRIC = "position_rmse_m"
SCENARIO = ["dataset", "disturbance"]
METHOD = ["filter", "adaptation"]
ADAPTED = ("baseline", "jerk", "eskf15")
GAIN = 0.95
"""The oracle gains something where its ratio to none is below this."""


def by_seed(rows: pd.DataFrame) -> pd.DataFrame:
    """The metric: a row a scenario and method, a column a seed; infinite where a run diverged, NaN: it was not run."""
    values = rows.assign(value=rows[METRIC].where(rows["status"] == "ok", np.inf))
    return values.pivot_table(index=[*SCENARIO, *METHOD], columns="seed", values="value")


def cell(values: pd.Series) -> str:
    """Mean with its interval, and how many runs diverged."""
    run = values.dropna()
    kept, lost = run[np.isfinite(run)], int(np.isinf(run).sum())
    (mean,), (low,), (high,) = mean_intervals(Samples.of([kept.to_numpy()]))
    text = f"{mean:.3g} [{low:.3g}, {high:.3g}]" if len(kept) else ""
    return f"{text} {lost}/{len(run)} diverged".strip() if lost else text


def ratios(table: pd.DataFrame, method: str, adaptation: str) -> pd.DataFrame:
    """For each scenario: ratio of the adaptation to none on the same seeds with its interval; diverged runs."""
    of, base = (table.xs((method, name), level=METHOD) for name in (adaptation, "none"))
    ends = np.array([ratio(of.loc[at].to_numpy(), base.loc[at].to_numpy()) for at in of.index]).reshape(-1, 3)
    columns = dict(zip(("ratio", "low", "high"), ends.T, strict=True))
    return pd.DataFrame({**columns, "diverged": np.isinf(of).sum(axis=1).to_numpy()}, index=of.index)


def ratio(of: np.ndarray, base: np.ndarray) -> tuple[float, float, float]:
    """Geometric mean of the ratios over the seeds that both came through, with Student's interval of the logarithms."""
    both = np.isfinite(of) & np.isfinite(base)
    d = np.log(of[both]) - np.log(base[both])
    if len(d) == 0:
        return np.nan, np.nan, np.nan
    ((low,), (high,)) = np.exp(student_intervals(np.asarray(d)[None], 0.95))
    return float(np.exp(np.mean(d))), float(low), float(high)


def best(table: pd.DataFrame, method: str, at: tuple[str, str]) -> str:
    """The adaptation with the lowest mean, of those that know no more than a filter can and lost no run."""
    rows = table.loc[at].loc[method].drop("oracle", errors="ignore")
    means = rows.mean(axis=1)
    means = means[np.isfinite(means)]
    return f"{means.idxmin()} {means.min():.3g}" if len(means) else "-"


def print_mtf(table: pd.DataFrame, method: str) -> None:
    """Print mtf beside none for each scenario, the gain first, and the best adaptation."""
    compared = ratios(table, method, "mtf")
    print(f"\n{method}: mtf against none (mean, ratio on the same seeds), and the best of all adaptations\n")
    for at in compared.sort_values("ratio", na_position="last").index:
        none, mtf = (cell(table.loc[(*at, method, name)]) for name in ("none", "mtf"))
        ratio = "{ratio:.3g} [{low:.3g}, {high:.3g}]".format(**compared.loc[at])
        print(f"{' '.join(at):<46}{none:<28}{mtf:<44}{ratio:<30}{best(table, method, at)}")


def print_adaptations(table: pd.DataFrame, method: str) -> None:
    """Print what each adaptation does over all scenarios: geometric mean of the ratios to none, the extremes."""
    print(f"\n{method}: each adaptation over all scenarios, ratios to none\n")
    lines = []
    for adaptation in table.xs(method, level="filter").index.unique("adaptation").drop("none"):
        compared = ratios(table, method, adaptation)
        kept = compared["ratio"].dropna().sort_values()
        ends = [f"{kept.iloc[end]:.3g} {' '.join(kept.index[end])}" for end in (0, -1)] if len(kept) else ["", ""]
        lines.append([adaptation, np.exp(np.log(kept).mean()), *ends, int(compared["diverged"].sum())])
    shown = pd.DataFrame(lines, columns=["adaptation", "mean", "least", "largest", "diverged runs"])
    print(shown.sort_values("mean").to_string(index=False, float_format="{:.3g}".format))


def print_oracle(table: pd.DataFrame, method: str) -> None:
    """Print what the oracle gains, and how much of that the adaptation that comes nearest does."""
    print(f"\n{method}: what the oracle leaves to gain (ratio to none), and the best adaptation\n")
    oracle = ratios(table, method, "oracle")
    for at, row in oracle[oracle["ratio"] < GAIN].sort_values("ratio").iterrows():
        mean = table.loc[(*at, method, "oracle")].mean()
        print(f"{' '.join(at):<46}{mean:<10.3g}{row['ratio']:<10.3g}{best(table, method, at)}")
    print(f"nothing to gain in {int((oracle['ratio'] >= GAIN).sum())} of {len(oracle)} scenarios")


def print_control(table: pd.DataFrame) -> None:
    """Print how far jerk and its control are apart."""
    both = [table.xs(model, level="filter").mean(axis=1).replace(np.inf, np.nan) for model in ("jerk", "bias")]
    apart = (np.log(both[0]) - np.log(both[1])).abs().dropna().sort_values()
    share = float((apart < np.log(1.01)).mean())
    print(f"\njerk against bias: within 1 % in {share:.1%} of {len(apart)} means; furthest apart:\n")
    for at, value in apart.tail(5).items():
        print(f"{' '.join(at):<60}{np.expm1(value):.1%} ({both[0][at]:.3g} and {both[1][at]:.3g} m)")


def print_filters(table: pd.DataFrame) -> None:
    """Print every filter and estimator without any adaptation, over the seeds that all of them ran."""
    runs = table.xs("none", level="adaptation").dropna(axis=1)
    print(f"\nno adaptation: mean of each filter over {runs.shape[1]} seeds [m]\n")
    means = runs.mean(axis=1).rename("mean").reset_index()
    shown = means.pivot_table(index=SCENARIO, columns="filter", values="mean")
    print(shown.to_string(float_format="{:.3g}".format))


def main(folder: Path) -> None:
    """Print all of it."""
    table = by_seed(pd.read_csv(folder / "rows.csv"))
    filters = table.index.unique("filter")
    for method in filters.intersection(ADAPTED, sort=False):
        print_mtf(table, method)
        print_adaptations(table, method)
        print_oracle(table, method)
    if {"jerk", "bias"} <= set(filters):
        print_control(table)
    print_filters(table)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
