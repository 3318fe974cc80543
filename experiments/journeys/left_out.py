"""Comparison of equally tuned methods on real recordings, with leave-one-group-out cross-validation.

A replicate is a trip, which may have several receivers and therefore several recordings. Each method has 48 settings:
the default setting, and points of a Sobol sequence over all its ranges and the factors on R. It is tuned 16 times. Each
tuning uses 24 of the settings, with the same indices for all methods. For each group it selects the setting with the
lowest mean log error on all other groups, with equal weights of the replicates. The value of a replicate is the median
of log(error/error of the plain filter) over its recordings and the tunings. Both methods are tuned in the same way.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.campaign.entry import ratio_verdict
from jerkbench.campaign.runs import CampaignRuns, FaultScenario, MethodSpec, Space, tried_settings, tunable_space
from jerkbench.evaluation.intervals import median_intervals, quantiles_of_rows
from jerkbench.evaluation.judgement import sign_p
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.names import choose
from jerkbench.jobs.progress import Progress

SETTINGS, EACH, TUNINGS = 48, 24, 16

PLAIN = "none"
"""Name of the adaptation of the plain filter."""

DIVERGED_RATIO = 100.0
"""Error of a diverged run, as a multiple of the error of the plain filter with default settings on that recording."""

MARGIN = 0.1
"""Ratios from 1/1.1 to 1.1 count as equal."""

ERROR = "position_rmse_horizontal_m"
"""Metric of the error."""

ROWS = "errors.parquet"
"""Name of the file of the stored rows."""

COLUMNS = ("recording", "filter", "adaptation", "setting", "error_m")
"""Columns of the stored rows. The error of a diverged run is NaN."""

Method = tuple[str, str]
"""Names of a filter and of an adaptation."""


class Taken(NamedTuple):
    """The n recordings of a population.

    Attributes:
        recording: (n,) names of the recordings.
        replicate: (n,) name of the replicate of each recording.
        group: (n,) name of the group that is left out together with each recording.
    """

    recording: Sequence[str]
    replicate: Sequence[str]
    group: Sequence[str]

    @property
    def replicates(self) -> list[str]:
        """The names of the replicates, in order."""
        return list(dict.fromkeys(self.replicate))


def setting_rows(
    scenarios: Mapping[str, FaultScenario],
    methods: Sequence[MethodSpec],
    limits: Protocol,
    runs: CampaignRuns,
    seeds: Mapping[str, int] | None = None,
    only: Mapping[Method, Collection[int]] | None = None,
) -> pd.DataFrame:
    """Run each setting of each method on each recording, and return `COLUMNS`. Stored runs are not repeated.

    Args:
        scenarios: the scenarios by the name of the recording.
        methods: the methods.
        limits: the protocol of each run.
        runs: storage of the runs.
        seeds: the seeds by the name of the recording; 0 by default.
        only: the indices of the settings to run for each method; all by default.

    Raises:
        JerkbenchError: a method does not run on a recording, or a recording is damaged.
    """
    first = next(iter(scenarios.values()))
    tried = [tried_settings(SETTINGS, tunable_space(method.job(first, limits))) for method in methods]
    labels = [(str(method.filter["name"]), str(method.adaptation["name"])) for method in methods]
    tries = [
        (name, k, trial)
        for name in scenarios
        for k, settings in enumerate(tried)
        for trial in range(len(settings))
        if only is None or trial in only[labels[k]]
    ]

    @cache
    def job_of(name: str, k: int) -> tuple[Job, Space]:
        job = methods[k].job(scenarios[name], limits)
        return replace(job, draws=[(seeds or {}).get(name, 0)]), tunable_space(job)

    def jobs() -> Iterator[Job]:
        for name, k, trial in tries:
            job, space = job_of(name, k)
            yield space.applied(job, tried[k][trial])

    with Progress(len(tries), doing="Recordings", unit="runs") as bar:
        rows = runs.rows(jobs(), [ERROR], bar)
    names = pd.DataFrame([(name, *labels[k], trial) for name, k, trial in tries], columns=list(COLUMNS[:4]))
    table = names.iloc[rows["job_index"]].reset_index(drop=True)
    error_m = rows[ERROR].where(rows["status"] == "ok").astype("float32")
    return table.astype({"setting": "int8"}).assign(error_m=error_m)


def answer(results: Path, title: str, study: str, sentences: str, unit: str) -> None:
    """Write the finding of a study, which the page of the audit includes. Links are relative to experiments/audit."""
    tuned = "Each recording was evaluated with settings that were tuned on other groups of recordings."
    ratio = f"For each {unit}, the error with an adaptation is divided by the error of the plain filter."
    average = f"The *average error ratio* of a {unit} is the geometric mean of these ratios over the adaptations."
    shown = f"The list shows the median of the average error ratio over the {unit}s, with its 95 % interval:"
    head = f"**{title}** ([details](../{study}/README.md)). {tuned} {ratio} {average} {shown}"
    write_text(results / "answer.md", f"{head}\n\n{sentences}\n")


def store(folder: Path, rows: pd.DataFrame, scenarios: Mapping[str, FaultScenario], protocol: str) -> None:
    """Write the rows and a manifest with their origin to ``folder``.

    Raises:
        OSError: it cannot be written.
    """
    coded = rows.astype({name: "category" for name in rows if name not in ("setting", "error_m")})
    write_atomically(folder / ROWS, lambda path: coded.to_parquet(path, index=False))
    data = {name: plugins.create("dataset", choose("dataset", of.dataset).plain) for name, of in scenarios.items()}
    manifest = {
        "protocol": protocol,
        "code": code_digest(),
        "git_commit": git_commit(),
        "versions": versions(),
        "recordings": {name: dataset.fingerprint() for name, dataset in data.items()},
    }
    write_text(folder / "manifest.json", json.dumps(manifest, indent=1) + "\n")


def log_errors(rows: pd.DataFrame, recordings: Sequence[str], plain: Method) -> dict[Method, FloatArray]:
    """Return the log errors (settings, n) of each method on n recordings; NaN for a setting that was not run.

    ``plain`` is the method that defines the error of a diverged run.
    """
    known = rows.assign(error_m=rows["error_m"].fillna(np.inf))
    wide = known.pivot_table(index=["filter", "adaptation", "setting"], columns="recording", values="error_m")
    wide = wide[list(recordings)]
    logs = np.log(wide.where(np.isfinite(wide), DIVERGED_RATIO * wide.loc[(*plain, 0)], axis=1))
    return {
        (str(model), str(rule)): of.droplevel([0, 1]).reindex(range(of.index[-1][2] + 1)).to_numpy(dtype=np.float64)
        for (model, rule), of in logs.groupby(["filter", "adaptation"])
    }


def tried() -> list[IntArray]:
    """Return the indices of the settings that each tuning uses."""
    return [np.sort(np.random.default_rng(r).choice(SETTINGS, EACH, replace=False)) for r in range(TUNINGS)]


def settings_elsewhere(loss: FloatArray, taken: Taken) -> IntArray:
    """Return (16, n) the index of the best setting on all groups except the group of each recording.

    Args:
        loss: (48, n) log errors; (1, n) for a method without tunable parameters.
        taken: the n recordings.
    """
    replicate, group = np.array(taken.replicate), np.array(taken.group)
    best = np.zeros((TUNINGS, loss.shape[1]), dtype=np.int64)
    for left_out in dict.fromkeys(taken.group) if len(loss) > 1 else ():
        others = dict.fromkeys(replicate[group != left_out])
        mean = np.mean([loss[:, replicate == name].mean(axis=1) for name in others], axis=0)
        best[:, group == left_out] = [[seen[mean[seen].argmin()]] for seen in tried()]
    return best


def tuned_elsewhere(loss: FloatArray, taken: Taken) -> FloatArray:
    """Return (16, n) the loss on each recording with the best setting on all other groups."""
    return np.asarray(loss[settings_elsewhere(loss, taken), np.arange(loss.shape[1])])


def of_replicates(values: FloatArray, taken: Taken) -> FloatArray:
    """Return (j,) medians of (16, n) values over the tunings and the recordings of each replicate."""
    replicate = np.array(taken.replicate)
    return np.array([np.median(values[:, replicate == name]) for name in taken.replicates])


@dataclass(frozen=True)
class OverReplicates:
    """A ratio of errors over replicates; below 1 is better.

    Attributes:
        median: median over the replicates.
        low: lower end of its 95 % interval.
        high: upper end of the interval.
        exact: ends of the interval of the exact sign test, whose coverage is at least 95 %.
        p: p-value of the sign test.
        wins: number of replicates with a ratio below 1.
        n: number of replicates.
        worst: name of the replicate with the largest ratio.
        worst_ratio: its ratio.
    """

    median: float
    low: float
    high: float
    exact: tuple[float, float]
    p: float
    wins: int
    n: int
    worst: str
    worst_ratio: float

    @property
    def equal(self) -> bool:
        """True if the exact interval lies within 10 %."""
        return self.exact[0] >= 1.0 / (1.0 + MARGIN) and self.exact[1] <= 1.0 + MARGIN

    @property
    def verdict(self) -> str:
        """Verdict of the exact interval. It is valid for a single test, not for the best of several methods."""
        return ratio_verdict(*self.exact, MARGIN)


def over_replicates(d: FloatArray, taken: Taken) -> OverReplicates:
    """Return the result of (16, n) log ratios of two methods."""
    each = of_replicates(d, taken)
    median, low, high, *_ = (float(np.exp(value[0])) for value in quantiles_of_rows(each[None]))
    exact = tuple(float(np.exp(end[0])) for end in median_intervals(np.sort(each)[None], 0.95, exact=True))
    wins, worst = int((each < 0).sum()), int(each.argmax())
    return OverReplicates(
        median,
        low,
        high,
        (exact[0], exact[1]),
        sign_p(wins, int((each > 0).sum())),
        wins,
        len(each),
        taken.replicates[worst],
        float(np.exp(each[worst])),
    )


def average_method(losses: Mapping[Method, FloatArray]) -> FloatArray:
    """Return (16, n) mean log ratios of the published or simplified adaptations to the plain filter of their model."""
    return np.mean([d for method, d in against_plain(losses).items() if _kind(method[1]) != "own"], axis=0)


def against_plain(losses: Mapping[Method, FloatArray]) -> dict[Method, FloatArray]:
    """Return (16, n) log ratios of each adaptation to the equally tuned plain filter of its model."""
    return {method: loss - losses[method[0], PLAIN] for method, loss in losses.items() if method[1] != PLAIN}


def _kind(adaptation: str) -> str:
    return str(plugins.get("adaptation", adaptation).provenance.kind)


def ratio_sentence(d: FloatArray, taken: Taken, unit: str) -> str:
    """Return the result of (16, n) log ratios as one line; ``unit`` is the noun for a replicate."""
    result = over_replicates(d, taken)
    low, high = result.exact
    value = f"{result.median:.2f} [{low:.2f}, {high:.2f}]"
    median = f"the median of the average error ratio over the {result.n} {unit}s is {value}."
    wins = f"On average, the adaptations reduce the error on {result.wins} of {result.n} {unit}s"
    test = f"(sign test, p = {result.p:.2g}: **{result.verdict}**)."
    largest = f"The {unit} `{result.worst}` has the largest average error ratio, {result.worst_ratio:.2f}."
    return f"{median} {wins} {test} {largest}"


def ratio_table(losses: Mapping[Method, FloatArray], taken: Taken, unit: str) -> str:
    """Return a table with a line for each adaptation, sorted by the median, as Markdown."""
    wins = f"better on (of {len(taken.replicates)})"
    lines = [["method", "origin", "median ratio [95 %]", "within 10 %", wins, f"worst {unit}"], ["---"] * 6]
    found = {method: over_replicates(d, taken) for method, d in against_plain(losses).items()}
    for (model, rule), of in sorted(found.items(), key=lambda item: item[1].median):
        ratio, worst = f"{of.median:.2f} [{of.low:.2f}, {of.high:.2f}]", f"{of.worst} {of.worst_ratio:.2f}"
        lines.append([f"{model} + {rule}", _kind(rule), ratio, "yes" if of.equal else "", f"{of.wins}", worst])
    return markdown_lines(lines)


def error_table(losses: Mapping[str, FloatArray], taken: Taken, unit: str) -> str:
    """Return a table with the errors [m] of some methods, by their names, on each replicate, as Markdown."""
    each = np.exp([of_replicates(loss, taken) for loss in losses.values()])
    group = dict(zip(taken.replicate, taken.group, strict=True))
    heads = [unit, "left out with", *(f"{name} [m]" for name in losses)]
    rows = zip(taken.replicates, each.T, strict=True)
    lines = [[name, group[name], *(f"{error:.3g}" for error in errors)] for name, errors in rows]
    return markdown_lines([heads, ["---"] * len(heads), *lines])


def markdown_lines(lines: Iterable[Sequence[str]]) -> str:
    """Return the lines of a table."""
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
