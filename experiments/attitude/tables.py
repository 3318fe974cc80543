"""The tables of the study: all methods are tuned in the same way, on the trials of other sessions.

Each method is tuned 16 times. A tuning tries 16 of the 64 settings, with the same indices for all methods. For each
session, the tuning selects the setting with the lowest median log error on the other sessions of the domain. A few
trials with very large errors cannot decide a median. The value of a trial is the median over the tunings.

Trials with a saturated gyro are excluded from the tuning, the ratios and the verdicts.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from trials import DEFAULTS, DOMAINS, METHODS, SETTINGS, plain_table, session_of

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.intervals import quantiles_of_rows
from jerkbench.evaluation.judgement import sign_p

TUNINGS, TRIED_EACH = 16, 16

MAX_SATURATED = 0.01
"""Largest fraction of saturated gyro samples of a trial that is not excluded."""

Losses = Mapping[str, FloatArray]
"""For each method, the log of the error [deg]."""


@dataclass(frozen=True)
class DomainErrors:
    """Errors on the n trials of a domain.

    Attributes:
        trials: names of the trials.
        sessions: (n,) session of each trial.
        excluded: (n,) True if the trial is excluded from the tuning and the ratios.
        losses: for each method, (64, n) of its settings, or (1, n) of its default setting.
    """

    trials: list[str]
    sessions: np.ndarray
    excluded: BoolArray
    losses: Losses

    def on_other_sessions(self, method: str, session: str) -> FloatArray:
        """Return the losses (64, k) of a method on the trials that its tuning for a session uses."""
        return self.losses[method][:, (self.sessions != session) & ~self.excluded]


Errors = Mapping[str, DomainErrors]
"""For each domain."""


def errors_of(rows: pd.DataFrame, saturated: pd.DataFrame) -> Errors:
    """Return the rows as arrays, with the trials in the order of their names.

    ``saturated`` has the columns domain, trial and fraction. It needs no row for trials without saturated samples.
    """
    beyond = saturated[saturated["fraction"] > MAX_SATURATED]
    found = {}
    for domain in (domain for domain in DOMAINS if domain in set(rows["domain"])):
        table = rows[rows["domain"] == domain].pivot_table(
            index=["method", "setting"], columns="trial", values="inclination_rmse_deg"
        )
        names = [str(name) for name in table.columns]
        losses = {str(name): np.log(own.to_numpy(dtype=np.float64)) for name, own in table.groupby(level="method")}
        excluded = np.isin(names, beyond.loc[beyond["domain"] == domain, "trial"].to_list())
        found[domain] = DomainErrors(names, np.array([session_of(domain, name) for name in names]), excluded, losses)
    return found


def tried() -> list[IntArray]:
    """The settings that each tuning tries."""
    return [np.sort(np.random.default_rng(r).choice(SETTINGS, TRIED_EACH, replace=False)) for r in range(TUNINGS)]


def lowest(losses: Sequence[FloatArray]) -> int:
    """Return the index of the setting with the lowest median over the trials; the mean decides between equal medians.

    If there are several domains, the medians (means) of the domains are added.
    """
    median, mean = (sum(average(loss, axis=1) for loss in losses) for average in (np.median, np.mean))
    return int(np.lexsort((mean, median))[0])


def best_settings(losses: Sequence[FloatArray]) -> IntArray:
    """Return (16,) the setting that each tuning selects."""
    return np.array([subset[lowest([loss[subset] for loss in losses])] for subset in tried()])


def settings_left_out(domain: DomainErrors, method: str, others: Sequence[FloatArray] = ()) -> IntArray:
    """Return (16, n) the setting that each tuning selects for each trial, without the trials of its session.

    ``others`` are losses on other domains, which are used too.
    """
    chosen = {
        session: best_settings([domain.on_other_sessions(method, session), *others]) for session in set(domain.sessions)
    }
    return np.stack([chosen[session] for session in domain.sessions], axis=1)


def losses_left_out(loss: FloatArray, setting: IntArray) -> FloatArray:
    """Return (16, n) the loss of the settings on the trials that were left out."""
    return loss[setting, np.arange(loss.shape[1])]


def losses_on(domain: DomainErrors, *, excluded: bool = False) -> dict[str, FloatArray]:
    """Return (16, k) for each tuned method and (1, k) for each default, on the k trials that are (not) excluded."""
    tuned = {name: losses_left_out(domain.losses[name], settings_left_out(domain, name)) for name in METHODS}
    return {name: loss[:, domain.excluded == excluded] for name, loss in {**domain.losses, **tuned}.items()}


def holm(p: Sequence[float]) -> list[float]:
    """Return the p adjusted for all of them (Holm 1979)."""
    order, adjusted = np.argsort(p, kind="stable"), np.empty(len(p))
    adjusted[order] = np.maximum.accumulate(np.minimum(1.0, np.arange(len(p), 0, -1) * np.asarray(p)[order]))
    return list(adjusted.tolist())


@dataclass(frozen=True)
class Verdict:
    """A method against another one; ratios of errors, below 1 is better.

    Attributes:
        median: over trials, and the ends of its 95 % interval.
        wins: on how many trials it is better.
        n: of how many.
        p: of the sign test, adjusted for all methods.
        word: better, worse or undecided, at 5 %.
    """

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
        ratio = tuple(np.exp(median).tolist())
        verdicts[name] = Verdict(ratio, int((own < 0).sum()), len(own), adjusted, word)
    return verdicts


# The tables, as Markdown.

COMPARATORS = ("constant", "vqf")
"""Chosen before the rows were seen: the plain filter, and the field's best."""

RECORDED = ("broad", "tstick", "kitti_start")
"""Domains of which a setting may be tried on another: a simulation tells nothing about a hand."""

TUNED_ELSEWHERE = {("broad", "vqf"): "vqf (its authors tuned its defaults on this set)"}
"""What a reader has to know of a method in a domain."""

VERDICT_HEADS = ("median ratio", "wins", "p (Holm)", "verdict")
DEFAULT_HEADS = ("default: median ratio", "default: verdict")


def of_errors(errors: Errors) -> str:
    """Median and largest error over the trials of each domain, tuned and with the default setting."""
    losses = {domain: losses_on(own) for domain, own in errors.items()}
    rows = []
    for name in [*METHODS, *DEFAULTS]:
        degs = [np.exp(np.median(own[name], axis=0)) for own in losses.values()]
        rows.append([name, *(f"{np.median(deg):.2f} / {deg.max():.2f}" for deg in degs)])
    return plain_table(["method", *(_title(domain, own) for domain, own in errors.items())], rows)


def _title(domain: str, own: DomainErrors) -> str:
    sessions = own.sessions[~own.excluded]
    return f"{DOMAINS[domain]} ({len(sessions)} trials, {len(set(sessions))} sessions)"


def of_verdicts(errors: Errors) -> str:
    """Each method against both comparison methods, for each domain: first tuned, then with the default settings."""
    parts = []
    for domain, known in errors.items():
        losses = losses_on(known)
        for comparator in COMPARATORS:
            head = [f"{_title(domain, known)}: against {comparator}", *VERDICT_HEADS, *DEFAULT_HEADS]
            tuned = verdicts_on({name: losses[name] for name in METHODS}, comparator)
            default = verdicts_on({name: losses[f"{name}, default"] for name in METHODS}, comparator)
            lines = [
                [TUNED_ELSEWHERE.get((domain, name), name), *verdict_cells(own), *verdict_cells(default[name])[::3]]
                for name, own in tuned.items()
            ]
            parts.append(plain_table(head, lines))
    return "\n\n".join(parts)


def verdict_cells(verdict: Verdict) -> list[str]:
    """Return the cells of the columns `VERDICT_HEADS`."""
    ratio, low, high = verdict.median
    return [f"{ratio:.2f} [{low:.2f}, {high:.2f}]", f"{verdict.wins}/{verdict.n}", f"{verdict.p:.2g}", verdict.word]


def of_transfer(errors: Errors) -> str:
    """Factor of the error with one setting for all recorded domains, and with a setting of another domain."""
    domains = [domain for domain in RECORDED if domain in errors]
    pairs = [(source, domain) for domain in domains for source in domains if source != domain]
    rows = []
    for method in METHODS:
        used = {domain: errors[domain].losses[method][:, ~errors[domain].excluded] for domain in domains}
        cells = [method]
        for domain in domains:
            others = [used[other] for other in domains if other != domain]
            cells.append(_factor(errors[domain], method, settings_left_out(errors[domain], method, others)))
        for source, domain in pairs:
            best = best_settings([used[source]])[:, None]
            cells.append(_factor(errors[domain], method, best))
        rows.append(cells)
    heads = [*(f"all on {domain}" for domain in domains), *(f"{source} on {domain}" for source, domain in pairs)]
    return plain_table(["method", *heads], rows)


def _factor(own: DomainErrors, method: str, setting: IntArray) -> str:
    """Median over the trials, compared with the settings that were tuned on the same domain."""
    loss = own.losses[method]
    more = losses_left_out(loss, setting) - losses_left_out(loss, settings_left_out(own, method))
    return f"{np.exp(np.median(np.median(more[:, ~own.excluded], axis=0))):.2f}"


TABLES: dict[str, Callable[[Errors], str]] = {
    "errors": of_errors,
    "verdicts": of_verdicts,
    "transfer": of_transfer,
}
"""For each name on the page."""
