"""The tables of the study: the filters tuned in the same way, each trial scored with a setting chosen on the others.

Each method is tuned 16 times. A tuning sees 16 of the 64 settings, the same numbers for all methods, and for each trial
takes the one with the lowest mean log error on the domain's other trials. The value of a trial is the median over the
tunings; trials are what is counted.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from trials import DEFAULTS, DOMAINS, METHODS, SETTINGS

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.intervals import quantiles_of_rows, student_intervals
from jerkbench.evaluation.judgement import sign_p
from jerkbench.report.writers import plain_table

TUNINGS, TRIED_EACH = 16, 16

DomainErrors = Mapping[str, FloatArray]
"""By method, log of the error [deg] of each setting on each trial: (64, n), or (1, n) as it comes."""

Errors = Mapping[str, DomainErrors]
"""By domain, those of its methods."""


def errors_of(rows: pd.DataFrame) -> Errors:
    """Return the rows as arrays, trials in the order of their names."""
    there = set(rows["domain"])
    found: dict[str, dict[str, FloatArray]] = {domain: {} for domain in DOMAINS if domain in there}
    for (domain, method), own in rows.groupby(["domain", "method"]):
        table = own.pivot_table(index="setting", columns="trial", values="inclination_rmse_deg")
        found[str(domain)][str(method)] = np.log(table.to_numpy(dtype=np.float64))
    return found


def tried() -> list[IntArray]:
    """The settings that each tuning sees."""
    return [np.sort(np.random.default_rng(r).choice(SETTINGS, TRIED_EACH, replace=False)) for r in range(TUNINGS)]


def settings_left_out(loss: FloatArray, others: FloatArray | float = 0.0) -> IntArray:
    """Return (16, n) the setting that each tuning takes where a trial is left out.

    ``loss`` (64, n) counts by the mean over the trials that stay; ``others`` (64,) is added to it.
    """
    left = (loss.sum(axis=1, keepdims=True) - loss) / (loss.shape[1] - 1) + np.reshape(others, (-1, 1))
    return np.array([subset[left[subset].argmin(axis=0)] for subset in tried()])


def losses_left_out(loss: FloatArray, setting: IntArray) -> FloatArray:
    """Return (16, n) the loss of the settings on the trials that were left out."""
    return loss[setting, np.arange(loss.shape[1])]


def tuned(errors: DomainErrors) -> dict[str, FloatArray]:
    """Return (16, n) for each method that is tuned."""
    return {method: losses_left_out(errors[method], settings_left_out(errors[method])) for method in METHODS}


def holm(p: Sequence[float]) -> list[float]:
    """Return the p adjusted for all of them (Holm 1979)."""
    order, adjusted = np.argsort(p, kind="stable"), np.empty(len(p))
    adjusted[order] = np.maximum.accumulate(np.minimum(1.0, np.arange(len(p), 0, -1) * np.asarray(p)[order]))
    return list(adjusted.tolist())


@dataclass(frozen=True)
class Verdict:
    """A method against another one; ratios of errors, below 1 is better.

    Attributes:
        mean: geometric mean over trials, and the ends of Student's 95 % interval.
        median: over trials, and the ends of its 95 % interval.
        wins: on how many trials it is better.
        n: of how many.
        p: of the sign test, adjusted for all methods.
        word: better, worse or undecided, at 5 %.
    """

    mean: tuple[float, float, float]
    median: tuple[float, float, float]
    wins: int
    n: int
    p: float
    word: str


def verdicts_on(losses: Mapping[str, FloatArray], comparator: str) -> dict[str, Verdict]:
    """Return the verdict on each other method, from (16, n) losses."""
    d = {name: np.median(loss - losses[comparator], axis=0) for name, loss in losses.items() if name != comparator}
    p = holm([sign_p(int((own < 0).sum()), int((own > 0).sum())) for own in d.values()])
    verdicts = {}
    for (name, own), adjusted in zip(d.items(), p, strict=True):
        median = tuple(float(value[0]) for value in quantiles_of_rows(own[None])[:3])
        word = "undecided" if adjusted >= 0.05 else "better" if median[0] < 0 else "worse"
        mean = float(own.mean()), *(float(end[0]) for end in student_intervals(own[None], 0.95))
        first, second = (tuple(np.exp(values).tolist()) for values in (mean, median))
        verdicts[name] = Verdict(first, second, int((own < 0).sum()), len(own), adjusted, word)
    return verdicts


# The tables, as Markdown.

COMPARATORS = ("constant", "vqf")
"""Chosen before the rows were seen: the plain filter, and the field's best."""

RECORDED = ("broad", "tstick", "kitti_start")
"""Domains of which a setting may be tried on another: a simulation tells nothing about a hand."""

TUNED_ELSEWHERE = {("broad", "vqf"): "vqf (its authors tuned its defaults on this set)"}
"""What a reader has to know of a method in a domain."""

VERDICT_HEADS = ("mean ratio", "median ratio", "wins", "p (Holm)", "verdict")


def of_errors(errors: Errors) -> str:
    """Median, mean and worst trial of each method and domain, tuned and as it comes."""
    losses, rows = [{**own, **tuned(own)} for own in errors.values()], []
    for name in [*METHODS, *DEFAULTS]:
        degs = [np.exp(np.median(own[name], axis=0)) for own in losses]
        rows.append([name, *(f"{np.median(deg):.2f} / {deg.mean():.2f} / {deg.max():.2f}" for deg in degs)])
    heads = (f"{DOMAINS[domain]} (n = {own['constant'].shape[1]})" for domain, own in errors.items())
    return plain_table(["method", *heads], rows)


def of_verdicts(errors: Errors) -> str:
    """Each method against both comparators, domain by domain."""
    parts = []
    for domain, known in errors.items():
        losses = tuned(known)
        for comparator in COMPARATORS:
            found = verdicts_on(losses, comparator)
            head = [f"{DOMAINS[domain]}: against {comparator}", *VERDICT_HEADS]
            lines = [[TUNED_ELSEWHERE.get((domain, name), name), *verdict_cells(own)] for name, own in found.items()]
            parts.append(plain_table(head, lines))
    return "\n\n".join(parts)


def verdict_cells(verdict: Verdict) -> list[str]:
    """Return what stands below `VERDICT_HEADS`."""
    ratios = [f"{ratio:.2f} [{low:.2f}, {high:.2f}]" for ratio, low, high in (verdict.mean, verdict.median)]
    return [*ratios, f"{verdict.wins}/{verdict.n}", f"{verdict.p:.2g}", verdict.word]


def of_transfer(errors: Errors) -> str:
    """How many times larger the error is with one setting for all recorded domains, and with that of another one."""
    domains = [domain for domain in RECORDED if domain in errors]
    pairs = [(source, domain) for domain in domains for source in domains if source != domain]
    rows = []
    for method in METHODS:
        loss = {domain: errors[domain][method] for domain in domains}
        own = {domain: losses_left_out(loss[domain], settings_left_out(loss[domain])) for domain in domains}
        means = {domain: loss[domain].mean(axis=1) for domain in domains}
        cells = [method]
        for domain in domains:
            others = np.sum([means[d] for d in domains if d != domain], axis=0)
            cells.append(_times(losses_left_out(loss[domain], settings_left_out(loss[domain], others)), own[domain]))
        for source, domain in pairs:
            best = [subset[means[source][subset].argmin()] for subset in tried()]
            cells.append(_times(loss[domain][best], own[domain]))
        rows.append(cells)
    heads = [*(f"all on {domain}" for domain in domains), *(f"{source} on {domain}" for source, domain in pairs)]
    return plain_table(["method", *heads], rows)


def _times(loss: FloatArray, own: FloatArray) -> str:
    return f"{np.exp(np.median(loss - own, axis=0).mean()):.2f}"


def of_switches(errors: Errors) -> str:
    """In which share of tunings and folds a switch is on."""
    rows = []
    for name, method in METHODS.items():
        settings = method.settings()
        for switch in (*method.switches, "gravity"):
            on = np.array([setting[switch] for setting in settings])
            rows.append([name, switch, *(f"{on[settings_left_out(own[name])].mean():.2f}" for own in errors.values())])
    return plain_table(["method", "switch", *errors], rows)


def of_luck(errors: Errors) -> str:
    """Standard deviation over the tunings of the mean log error."""
    by_domain = [tuned(own) for own in errors.values()]
    rows = [[name, *(f"{own[name].mean(axis=1).std(ddof=1):.2f}" for own in by_domain)] for name in METHODS]
    return plain_table(["method", *errors], rows)


TABLES: dict[str, Callable[[Errors], str]] = {
    "errors": of_errors,
    "verdicts": of_verdicts,
    "transfer": of_transfer,
    "switches": of_switches,
    "luck": of_luck,
}
"""By their names on a page."""
