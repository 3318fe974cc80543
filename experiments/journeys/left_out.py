"""Methods tuned alike on real recordings, each group of recordings left out in turn; what they are worth then.

A replicate is what is counted: a journey, whatever the number of receivers that rode in it. Each method has 48
settings: the one that it comes with, and points of a Sobol sequence over all its ranges and over the factors on R. It
is tuned 16 times. A tuning sees 24 of the settings, with the same numbers for all methods, and takes for each group the
one with the lowest mean log error on all other groups, where each replicate has the same weight. The value of a
replicate is the median over its recordings and the tunings of log(error/plain filter's error): of two methods that were
tuned alike.
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
from jerkbench.campaign.entry import ratio_word
from jerkbench.campaign.runs import CampaignRuns, FaultScenario, MethodSpec, tried_settings, tunable_space
from jerkbench.campaign.space import Space
from jerkbench.evaluation.intervals import median_intervals, quantiles_of_rows
from jerkbench.evaluation.judgement import sign_p
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.names import choose
from jerkbench.jobs.progress import Progress

SETTINGS, EACH, TUNINGS = 48, 24, 16

PLAIN = "none"
"""The adaptation that changes nothing."""

LOST = 100.0
"""A lost run counts so many times the error of the plain filter at its defaults on that recording."""

MARGIN = 0.1
"""Ratios from 1/1.1 to 1.1 are equal."""

ERROR = "position_rmse_horizontal_m"
"""The error."""

ROWS = "errors.parquet"
"""The file of the rows that are kept."""

COLUMNS = ("recording", "filter", "adaptation", "setting", "error_m")
"""Of the rows that are kept; the error of a lost run is NaN."""

Method = tuple[str, str]
"""Names of a filter and of an adaptation."""


class Taken(NamedTuple):
    """Which n recordings are taken, and what they count as.

    Attributes:
        recording: (n,) names.
        replicate: (n,) name of the replicate of each.
        group: (n,) name of what is left out together with it.
    """

    recording: Sequence[str]
    replicate: Sequence[str]
    group: Sequence[str]

    @property
    def replicates(self) -> list[str]:
        """Each replicate once, in order."""
        return list(dict.fromkeys(self.replicate))


def setting_rows(
    scenarios: Mapping[str, FaultScenario],
    methods: Sequence[MethodSpec],
    limits: Protocol,
    runs: CampaignRuns,
    seeds: Mapping[str, int] | None = None,
    only: Mapping[Method, Collection[int]] | None = None,
) -> pd.DataFrame:
    """Run each setting of each method on each recording, and return `COLUMNS`; what is stored is not run again.

    Args:
        scenarios: by the name of the recording.
        methods: the methods.
        limits: how each run is judged.
        runs: where they are stored.
        seeds: by the name of the recording; default: 0.
        only: the numbers of the settings to run of each method; default: all.

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
    table = names.iloc[rows["place"]].reset_index(drop=True)
    error_m = rows[ERROR].where(rows["status"] == "ok").astype("float32")
    return table.astype({"setting": "int8"}).assign(error_m=error_m)


def answer(results: Path, what: str, study: str, sentences: str) -> None:
    """Write what was found where the audit's page looks for it; links are those of a page in experiments/audit."""
    head = f"**{what}** ([all of it](../{study}/README.md)). The average adaptation, tuned on other places, has:"
    write_text(results / "answer.md", f"{head}\n\n{sentences}\n")


def keep(folder: Path, rows: pd.DataFrame, scenarios: Mapping[str, FaultScenario], protocol: str) -> None:
    """Write the rows, and what they were made with, to ``folder``.

    Raises:
        OSError: it cannot be written.
    """
    kept = rows.astype({name: "category" for name in rows if name not in ("setting", "error_m")})
    write_atomically(folder / ROWS, lambda path: kept.to_parquet(path, index=False))
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
    """Return the log errors (settings, n) of each method on n recordings; NaN of a setting that was not run.

    The level of a recording is what ``plain`` has there at its defaults.
    """
    known = rows.assign(error_m=rows["error_m"].fillna(np.inf))
    wide = known.pivot_table(index=["filter", "adaptation", "setting"], columns="recording", values="error_m")
    wide = wide[list(recordings)]
    logs = np.log(wide.where(np.isfinite(wide), LOST * wide.loc[(*plain, 0)], axis=1))
    return {
        (str(model), str(rule)): own.droplevel([0, 1]).reindex(range(own.index[-1][2] + 1)).to_numpy(dtype=np.float64)
        for (model, rule), own in logs.groupby(["filter", "adaptation"])
    }


def tried() -> list[IntArray]:
    """Return the settings that each tuning sees."""
    return [np.sort(np.random.default_rng(r).choice(SETTINGS, EACH, replace=False)) for r in range(TUNINGS)]


def settings_elsewhere(loss: FloatArray, taken: Taken) -> IntArray:
    """Return (16, n) the number of the setting that was best on all other groups than that of each recording.

    Args:
        loss: (48, n) log errors; (1, n) of a method with nothing to tune.
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
    """Return (16, n) the loss on each recording with the setting that was best on all other groups."""
    return np.asarray(loss[settings_elsewhere(loss, taken), np.arange(loss.shape[1])])


def of_replicates(values: FloatArray, taken: Taken) -> FloatArray:
    """Return (j,) the median over the tunings, and the recordings of each replicate, of (16, n) values."""
    replicate = np.array(taken.replicate)
    return np.array([np.median(values[:, replicate == name]) for name in taken.replicates])


@dataclass(frozen=True)
class OverReplicates:
    """A ratio of errors over replicates; below 1 is better.

    Attributes:
        median: over the replicates.
        low: lower end of its 95 % interval.
        high: upper end.
        exact: the ends of the interval that the exact sign test gives, which never covers less than 95 %.
        p: of the sign test.
        wins: on how many replicates the ratio is below 1.
        n: how many there are.
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
        """Whether the whole exact interval lies within 10 %."""
        return self.exact[0] >= 1.0 / (1.0 + MARGIN) and self.exact[1] <= 1.0 + MARGIN

    @property
    def word(self) -> str:
        """What the exact interval shows: for one test alone, not for the best of several."""
        return ratio_word(*self.exact, MARGIN)


def over_replicates(d: FloatArray, taken: Taken) -> OverReplicates:
    """Return what (16, n) log ratios of two methods show."""
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
    """Return (16, n) the average adaptation, published or simplified, against the plain filter of its model."""
    return np.mean([d for method, d in against_plain(losses).items() if _kind(method[1]) != "own"], axis=0)


def against_plain(losses: Mapping[Method, FloatArray]) -> dict[Method, FloatArray]:
    """Return (16, n) log ratios of each adaptation to the plain filter of its model, tuned alike."""
    return {method: loss - losses[method[0], PLAIN] for method, loss in losses.items() if method[1] != PLAIN}


def _kind(adaptation: str) -> str:
    return str(plugins.get("adaptation", adaptation).provenance.kind)


def ratio_sentence(d: FloatArray, taken: Taken, unit: str) -> str:
    """Say what (16, n) log ratios show, in one line; ``unit`` is what a replicate is."""
    own = over_replicates(d, taken)
    ratio = f"{own.median:.2f} [{own.exact[0]:.2f}, {own.exact[1]:.2f}] of the plain filter's error"
    return (
        f"{ratio}, better on {own.wins} of {own.n} {unit}s, p = {own.p:.2g}: **{own.word}**. Worst {unit}: {own.worst}"
        f" {own.worst_ratio:.2f}."
    )


def ratio_table(losses: Mapping[Method, FloatArray], taken: Taken, unit: str) -> str:
    """Return a line for each adaptation, the lowest median first, as Markdown."""
    wins = f"better on (of {len(taken.replicates)})"
    lines = [["method", "what it is", "median ratio [95 %]", "within 10 %", wins, f"worst {unit}"], ["---"] * 6]
    found = {method: over_replicates(d, taken) for method, d in against_plain(losses).items()}
    for (model, rule), own in sorted(found.items(), key=lambda item: item[1].median):
        ratio, worst = f"{own.median:.2f} [{own.low:.2f}, {own.high:.2f}]", f"{own.worst} {own.worst_ratio:.2f}"
        lines.append([f"{model} + {rule}", _kind(rule), ratio, "yes" if own.equal else "", f"{own.wins}", worst])
    return markdown_lines(lines)


def error_table(losses: Mapping[str, FloatArray], taken: Taken, unit: str) -> str:
    """Return the errors [m] of some methods, by their titles, on each replicate, as Markdown."""
    each = np.exp([of_replicates(loss, taken) for loss in losses.values()])
    group = dict(zip(taken.replicate, taken.group, strict=True))
    heads = [unit, "left out with", *(f"{name} [m]" for name in losses)]
    rows = zip(taken.replicates, each.T, strict=True)
    lines = [[name, group[name], *(f"{error:.3g}" for error in errors)] for name, errors in rows]
    return markdown_lines([heads, ["---"] * len(heads), *lines])


def markdown_lines(lines: Iterable[Sequence[str]]) -> str:
    """Return the lines of a table."""
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
