"""The tables of the page, from the kept rows.

    python experiments/attitude/page.py [PAGE]

prints them, or writes them into a page.

Each method is tuned 16 times. A tuning sees 16 of the 64 settings, the same numbers for all methods, and for each trial
takes the one with the lowest mean log error on the domain's other trials. The value of a trial is the median over the
tunings; trials are what is counted.
"""

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from methods import AS_THEY_COME, METHODS, SETTINGS
from run import KEPT

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.statistics.families import sign_p
from jerkbench.evaluation.statistics.intervals import quantiles_of_rows, student_interval

TUNINGS, EACH = 16, 16
DOMAINS = {"broad": "BROAD, hand", "tstick": "TStick, hand", "kitti": "KITTI, vehicle"}
KINEMATIC = ("baseline", "jerk")
NAVIGATION = Path(__file__).parent / "navigation.parquet"
STARTS = Path(__file__).parent / "starts.parquet"

COMPARATORS = ("constant", "vqf")
"""Chosen before the rows were seen: the plain filter, and the field's best."""

Errors = dict[str, dict[str, FloatArray]]
"""By domain and method, log of the error [deg] of each setting on each trial: (64, n), or (1, n) as it comes."""


def errors_of(rows: pd.DataFrame) -> Errors:
    """Return the rows as arrays, trials in the order of their names."""
    found: Errors = {domain: {} for domain in DOMAINS}
    for (domain, method), own in rows.groupby(["domain", "method"]):
        table = own.pivot_table(index="setting", columns="trial", values="inclination_rmse_deg")
        found[str(domain)][str(method)] = np.log(table.to_numpy(dtype=np.float64))
    return found


def tried() -> list[IntArray]:
    """The settings that each tuning sees."""
    return [np.sort(np.random.default_rng(r).choice(SETTINGS, EACH, replace=False)) for r in range(TUNINGS)]


def chosen(loss: FloatArray, others: FloatArray | float = 0.0, weight: float = 1.0) -> IntArray:
    """Return (16, n) the setting that each tuning takes where a trial is left out.

    ``loss`` (64, n) counts by the mean over the trials that stay, times ``weight``; ``others`` (64,) is added to it.
    """
    left = (loss.sum(axis=1, keepdims=True) - loss) / (loss.shape[1] - 1)
    left = weight * left + np.reshape(others, (-1, 1))
    return np.array([subset[left[subset].argmin(axis=0)] for subset in tried()])


def scored(loss: FloatArray, setting: IntArray) -> FloatArray:
    """Return (16, n) the loss of the settings on the trials that were left out."""
    return loss[setting, np.arange(loss.shape[1])]


def tuned(errors: Errors, domain: str) -> dict[str, FloatArray]:
    """Return (16, n) for each method that is tuned."""
    return {method: scored(errors[domain][method], chosen(errors[domain][method])) for method in METHODS}


def holm(p: Sequence[float]) -> list[float]:
    """Return the p adjusted for all of them (Holm 1979)."""
    order, adjusted, largest = np.argsort(p, kind="stable"), [0.0] * len(p), 0.0
    for rank, k in enumerate(order):
        largest = max(largest, min(1.0, (len(p) - rank) * p[k]))
        adjusted[k] = largest
    return adjusted


def verdicts(losses: dict[str, FloatArray], comparator: str) -> dict[str, list[str]]:
    """For each other method: mean ratio, median ratio, wins, p, verdict."""
    names = [name for name in losses if name != comparator]
    d = {name: np.median(losses[name] - losses[comparator], axis=0) for name in names}
    p = holm([sign_p(int((d[name] < 0).sum()), int((d[name] > 0).sum())) for name in names])
    return {name: _verdict(d[name], corrected) for name, corrected in zip(names, p, strict=True)}


def _verdict(d: FloatArray, p: float) -> list[str]:
    median, low, high, *_ = (float(value[0]) for value in quantiles_of_rows(d[None]))
    word = "undecided" if p >= 0.05 else "better" if median < 0 else "worse"
    spans = [(d.mean(), *student_interval(d, 0.95)), (median, low, high)]
    ratios = [f"{np.exp(m):.2f} [{np.exp(a):.2f}, {np.exp(b):.2f}]" for m, a, b in spans]
    return [*ratios, f"{(d < 0).sum()}/{len(d)}", f"{p:.2g}", word]


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def of_errors(errors: Errors) -> str:
    """Median, mean and worst trial of each method and domain, tuned and as it comes."""
    rows = []
    for name in [*METHODS, *AS_THEY_COME]:
        cells = [name]
        for domain in DOMAINS:
            loss = tuned(errors, domain)[name] if name in METHODS else errors[domain][name]
            deg = np.exp(np.median(loss, axis=0))
            cells.append(f"{np.median(deg):.2f} / {deg.mean():.2f} / {deg.max():.2f}")
        rows.append(cells)
    return table(["method", *(f"{title} (n = {_n(errors, d)})" for d, title in DOMAINS.items())], rows)


def of_verdicts(errors: Errors) -> str:
    """Each method against both comparators, domain by domain."""
    parts = []
    for domain, title in DOMAINS.items():
        for comparator in COMPARATORS:
            found = verdicts(tuned(errors, domain), comparator)
            head = [f"{title}: against {comparator}", "mean ratio", "median ratio", "wins", "p (Holm)", "verdict"]
            parts.append(table(head, [[name, *cells] for name, cells in found.items()]))
    return "\n\n".join(parts)


def of_transfer(errors: Errors) -> str:
    """How many times larger the error is with one setting for all domains, and with that of another one."""
    rows = []
    for method in METHODS:
        own = {domain: tuned(errors, domain)[method] for domain in DOMAINS}
        means = {domain: errors[domain][method].mean(axis=1) for domain in DOMAINS}
        cells = [method]
        for domain in DOMAINS:
            loss, others = errors[domain][method], sum(means[d] for d in DOMAINS if d != domain)
            cells.append(_times(scored(loss, chosen(loss, others)), own[domain]))
        for domain in DOMAINS:
            for source in DOMAINS:
                if source != domain:
                    best = [subset[means[source][subset].argmin()] for subset in tried()]
                    cells.append(_times(errors[domain][method][best], own[domain]))
        rows.append(cells)
    pairs = [f"{source} on {domain}" for domain in DOMAINS for source in DOMAINS if source != domain]
    return table(["method", *(f"all three on {domain}" for domain in DOMAINS), *pairs], rows)


def of_switches(errors: Errors) -> str:
    """In which share of tunings and folds a switch is on."""
    rows = []
    for name, method in METHODS.items():
        settings = method.settings()
        for switch in method.switches:
            on = np.array([setting[switch] for setting in settings])
            rows.append([name, switch, *(f"{on[chosen(errors[d][name])].mean():.2f}" for d in DOMAINS)])
    return table(["method", "switch", *DOMAINS], rows)


def of_luck(errors: Errors) -> str:
    """Standard deviation over the tunings of the mean log error."""
    rows = [[m, *(f"{tuned(errors, d)[m].mean(axis=1).std(ddof=1):.2f}" for d in DOMAINS)] for m in METHODS]
    return table(["method", *DOMAINS], rows)


def of_navigation(errors: Errors) -> str:
    """Position errors with each attitude against those with `constant`, and how much of the gap to eskf15 it closes."""
    del errors
    rows = pd.read_parquet(NAVIGATION)
    rows["loss"] = np.log(rows["position_rmse_m"].astype(float))
    mean = rows.pivot_table(index=["filter", "attitude"], columns="drive", values="loss")  # over the traces
    (inertial,) = mean.drop(index=list(KINEMATIC), level="filter").to_numpy()
    parts = []
    for model in KINEMATIC:
        own = {str(name): mean.loc[(model, name)].to_numpy()[None] for name in mean.loc[model].index}
        gap = float((own["constant"] - inertial).mean())
        gains = {name: (own["constant"] - own[name]).mean() for name in own}
        closed = {name: f"{gain / gap:.2f}" if gap > 0 else "-" for name, gain in gains.items()}
        found = verdicts(own, "constant")
        head = [f"{model} (n = {len(inertial)})", "mean ratio", "median ratio", "wins", "p (Holm)", "verdict", "closed"]
        parts.append(table(head, [[name, *cells, closed[name]] for name, cells in found.items()]))
        parts.append(f"eskf15 has {np.exp(-gap):.2f} times the error of {model} with `constant`.")
    return "\n\n".join(parts)


def of_starts(errors: Errors) -> str:
    """The error of each alignment at the first sample."""
    del errors
    found = pd.read_parquet(STARTS).groupby("alignment", sort=False)["error_deg"]
    cells = [[str(name), f"{own.median():.2f}", f"{own.max():.2f}"] for name, own in found]
    return table(["alignment", "median [deg]", "worst [deg]"], cells)


def _times(loss: FloatArray, own: FloatArray) -> str:
    return f"{np.exp(np.median(loss - own, axis=0).mean()):.2f}"


def _n(errors: Errors, domain: str) -> int:
    return errors[domain]["constant"].shape[1]


TABLES: dict[str, Callable[[Errors], str]] = {
    "errors": of_errors,
    "verdicts": of_verdicts,
    "transfer": of_transfer,
    "switches": of_switches,
    "luck": of_luck,
    "starts": of_starts,
    "navigation": of_navigation,
}


def filled(page: str, errors: Errors) -> str:
    """Return the page with each of its tables from the rows."""
    for name, make in TABLES.items():
        begin, end = f"<!-- {name} -->\n", "<!-- end -->"
        before, rest = page.split(begin)
        page = f"{before}{begin}{make(errors)}\n{end}{rest.split(end, 1)[1]}"
    return page


def main() -> None:
    """Print the tables, or write them into the page that is named."""
    errors = errors_of(pd.read_parquet(KEPT))
    if len(sys.argv) > 1:
        page = Path(sys.argv[1])
        page.write_text(filled(page.read_text(encoding="utf-8"), errors), encoding="utf-8")
    else:
        print("\n\n".join(make(errors) for make in TABLES.values()))


if __name__ == "__main__":
    main()
