"""The Python API on one screen.

From names to rows, and to a table of many::

    from jerkbench import api

    rows = api.run(filter="jerk", adaptation="mtf", seeds=3)                            # a DataFrame
    study = api.sweep("results/mine", filter=["baseline", "jerk"], adaptation=["none", "mtf"])
    print(api.table(study, baseline="adaptation=none"))                                 # Markdown; HTML in a notebook
    api.report(study)

Or step by step, each with plain objects in and out::

    recording = api.disturb(api.load("field", seed=1), "gnss_outage", seed=1)           # Recording
    estimate = api.estimate(recording, filter={"name": "jerk", "accel_mps2": 0.2})      # Estimate
    values = api.evaluate(estimate, recording)                                          # {"position_rmse_m": ...}
    api.figure(recording, {"jerk": estimate}).savefig("errors.png")

A part of a combination is a name (of a plugin or a preset), {"name": ..., parameter: value}, or a plugin of your own;
what is left out is what `jerkbench run` takes.
"""

import dataclasses
import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError, require_known
from jerkbench.estimate import Estimate
from jerkbench.jobs.job import Job, Protocol, metric_names, replaced
from jerkbench.jobs.names import Part, choose, is_plugin, job_of_parts, noise_of, plugin_of, require_sensible
from jerkbench.notices import notify
from jerkbench.recording import Recording

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from jerkbench.jobs.study import Study
    from jerkbench.report.table_model import Table

__all__ = ["Part", "disturb", "estimate", "evaluate", "figure", "load", "report", "run", "sweep", "table"]


def run(
    *,
    dataset: Part | None = None,
    disturbance: Part | Sequence[Part] = (),
    attitude: Part | None = None,
    filter: Part | None = None,  # noqa: A002 - the group's name
    adaptation: Part | None = None,
    noise: Part | None = None,
    engine: Part | None = None,
    seeds: int = Protocol.seeds,
    first_seed: int = Protocol.first_seed,
    burn_in_s: float = Protocol.burn_in_s,
    metrics: Sequence[str] = (),
    r_scale: Mapping[str, float] | None = None,
) -> "pd.DataFrame":
    """Run one combination; returns one row for each seed: factors, seed, status, reason, metrics.

    The same names with the same parameters give the same rows as on the command line; so do those that are left out
    (conf/config.yaml has them).

    Args:
        dataset: where the recordings come from.
        disturbance: one, or several in order.
        attitude: attitude filter; None: what the data set prefers (`rtklib`: the preset `real`), else `field`.
        filter: kinematic filter, or estimator.
        adaptation: rule that adapts R.
        noise: process noise that replaces the filter's own: a preset, or {"accel_mps2": ...}; None: the filter's own.
        engine: what runs a kinematic filter.
        seeds: number of runs, where anything is random.
        first_seed: the first of them.
        burn_in_s: errors count from this time on [s].
        metrics: names of those to compute, or ["all"]; empty: those that are cheap.
        r_scale: factors on the reported R that the filter is told: {"position": 2.0, "velocity": 0.5}; None: none.

    Raises:
        JerkbenchError: something is unknown or does not fit; a run that fails is a row.
    """
    import pandas as pd

    from jerkbench.jobs.rows import job_rows

    single = {"dataset": dataset, "attitude": attitude, "filter": filter, "adaptation": adaptation, "engine": engine}
    protocol = Protocol(seeds=seeds, first_seed=first_seed, burn_in_s=burn_in_s)
    job = job_of_parts(single, _listed(disturbance), noise, protocol, metrics, r_scale)
    require_sensible(job)
    rows, _ = job_rows(job)
    return pd.DataFrame(rows)


def _listed(parts: Part | Sequence[Part] | None) -> list[Part]:
    """Return one part, or several, as a list."""
    return list(parts) if isinstance(parts, list | tuple) else [parts]


Parts = Part | Sequence[Part] | None
"""One part, or several of which each is swept."""


def sweep(
    folder: Path | str,
    *,
    dataset: Parts = None,
    disturbance: Parts = None,
    attitude: Parts = None,
    filter: Parts = None,  # noqa: A002 - the group's name
    adaptation: Parts = None,
    noise: Parts = None,
    engine: Part | None = None,
    seeds: int = Protocol.seeds,
    first_seed: int = Protocol.first_seed,
    burn_in_s: float = Protocol.burn_in_s,
    metrics: Sequence[str] = (),
    notes: Sequence[str] = (),
    workers: int = 1,
) -> "Study":
    """Run every combination of the parts into ``folder``, as `jerkbench run -m` does; what is done is not run again.

    The arguments are those of `run`, each one part or a list of parts; a list inside the list of disturbances acts in
    order. With several ``workers``, plugins of your own have to be in a module that your script or notebook imports.

    Args:
        folder: of the study.
        dataset: as in `run`.
        disturbance: as in `run`.
        attitude: as in `run`.
        filter: as in `run`.
        adaptation: as in `run`.
        noise: as in `run`.
        engine: as in `run`.
        seeds: as in `run`.
        first_seed: as in `run`.
        burn_in_s: as in `run`.
        metrics: as in `run`.
        notes: sentences to print under the tables.
        workers: number of processes.

    Raises:
        JerkbenchError: something is unknown or does not fit, or every combination was left out.
    """
    from jerkbench.jobs.study import concluded

    axes = {"dataset": dataset, "attitude": attitude, "filter": filter, "adaptation": adaptation, "engine": [engine]}
    protocol = Protocol(seeds=seeds, first_seed=first_seed, burn_in_s=burn_in_s)
    ran = _run(_jobs({**axes, "disturbance": disturbance, "noise": noise}, protocol, metrics), Path(folder), workers)
    study, _ = concluded(Path(folder), ran, list(notes), sys.argv)
    return study


def _run(jobs: Iterator[Job], folder: Path, workers: int) -> dict[str, Sequence[int]]:
    """Run those of the jobs that make sense and are not done; returns the seeds of all that make sense, by key."""
    from jerkbench.jobs.executors import Workers
    from jerkbench.jobs.plan import planned
    from jerkbench.jobs.run import run_missing
    from jerkbench.jobs.store import Store

    plan = planned(jobs)
    for sentence in plan.refused:
        notify(sentence)
    if not plan.jobs:
        raise PluginError("There is nothing to run: every combination was left out.")
    if workers > 1:
        _require_modules(plan.jobs)
    with Workers(count=workers) as own:
        run_missing(plan, Store(folder), own)
    return plan.draws


def _require_modules(jobs: Iterable[Job]) -> None:
    """Refuse plugins that other processes cannot import."""
    for job in jobs:
        for _, _, plugin in job.parts():
            if plugins.of_script(type(plugin)):
                raise PluginError(
                    f"{type(plugin).__name__} is defined in the script itself, where other processes cannot find it: "
                    "give workers=1, or move it into a module that the script imports."
                )


def table(
    study: "Study | Path | str",
    metric: str | None = None,
    rows: Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
    baseline: str | None = None,
) -> "Table":
    """Return a table of a study; as text it is Markdown, in a notebook HTML.

    Args:
        study: a study, or its folder.
        metric: a column of rows.csv; None: position_rmse_m, or the first there is.
        rows: factors that make the rows; None: all that vary and are no columns.
        columns: factors that make the columns; None: the adaptation.
        baseline: add ratios to it: "adaptation=none".

    Raises:
        JerkbenchError: there are no results, or no such metric, factor or baseline.
    """
    from jerkbench.report.comparisons import parse_baseline
    from jerkbench.report.summary import main_metric, summarise

    opened = _opened(study)
    chosen = metric or main_metric(opened.rows)
    compared = parse_baseline(baseline) if baseline else None
    return summarise(opened.rows, chosen, rows, columns, opened.notes, baseline=compared)


def report(
    study: "Study | Path | str",
    path: Path | str | None = None,
    scenarios: int = 20,
    figures: str = "few",
    *,
    run_programs: bool = False,
) -> Path:
    """Write the report of a study as one HTML file; returns where.

    Args:
        study: a study, or its folder.
        path: the file; None: report.html in the study's folder.
        scenarios: show the runs of so many scenarios.
        figures: "few": of scenarios and methods that carry a finding; "all", or "none".
        run_programs: let programs that the stored results name run: only of results that you trust.

    Raises:
        JerkbenchError: there are no results.
    """
    from jerkbench.jobs.executors import processors
    from jerkbench.jobs.replay import tell_left_out
    from jerkbench.report import figures_choice
    from jerkbench.report.study_figures import REPORT, Request, write_report

    opened = _opened(study)
    written = Path(path) if path else opened.folder / REPORT
    request = Request(figures_choice(figures), scenarios, run_programs=run_programs)
    workers = 1 if plugins.any_of_script() else processors()
    tell_left_out(opened, run_programs=run_programs)
    write_report(opened, written, request, workers)
    return written


def _opened(study: "Study | Path | str") -> "Study":
    from jerkbench.jobs.study import Study

    return Study.open(study) if isinstance(study, Path | str) else study


def _jobs(axes: dict[str, Parts], protocol: Protocol, metrics: Sequence[str]) -> Iterator[Job]:
    for values in itertools.product(*map(_listed, axes.values())):
        parts = dict(zip(axes, values, strict=True))
        disturbance, noise = parts.pop("disturbance"), parts.pop("noise")
        yield job_of_parts(parts, [] if disturbance is None else _listed(disturbance), noise, protocol, metrics)


# A run step by step: plain objects in, plain objects out.


def load(dataset: Part | None = None, seed: int = Protocol.first_seed) -> Recording:
    """Return the recording of a data set; of a simulated one, that of ``seed``.

    Raises:
        JerkbenchError: it is unknown, its parameters do not fit, or its files cannot be read.
    """
    recording: Recording = plugin_of("dataset", dataset).load(seed)
    return recording


def disturb(recording: Recording, disturbance: Part | Sequence[Part], seed: int = Protocol.first_seed) -> Recording:
    """Return the recording after one disturbance, or several in order, with the random numbers of ``seed``.

    Raises:
        JerkbenchError: one is unknown, its parameters do not fit, or the recording lacks what it changes.
    """
    for part in _listed(disturbance):
        parts = [part] if is_plugin(part) else list(choose("disturbance", part).plain.values())
        for chosen in parts:
            plugin = chosen if is_plugin(chosen) else plugins.create("disturbance", chosen)
            recording = plugin.apply(recording, seed)
    return recording


def estimate(
    recording: Recording,
    *,
    filter: Part | None = None,  # noqa: A002 - the group's name
    adaptation: Part | None = None,
    attitude: Part | None = None,
    noise: Part | None = None,
    engine: Part | None = None,
) -> Estimate:
    """Return what a filter makes of a recording; the arguments are those of `run`.

    A recording does not say which attitude filter its data set prefers: of a recorded drive that is mostly
    ``attitude="real"``.

    Raises:
        JerkbenchError: something is unknown or does not fit, or the recording lacks an input.
    """
    from jerkbench.jobs.inputs import attitude_of
    from jerkbench.jobs.rows import solution

    model = plugin_of("filter", filter)
    model = dataclasses.replace(model, **replaced(type(model), noise_of(noise).plain))
    oriented = attitude_of(recording, plugin_of("attitude", attitude))
    return solution(recording, oriented, model, plugin_of("adaptation", adaptation), plugin_of("engine", engine))


def evaluate(
    estimate: Estimate, recording: Recording, *, metrics: Sequence[str] = (), burn_in_s: float = Protocol.burn_in_s
) -> dict[str, float]:
    """Return the metrics of an estimate against the recording's reference, by column name, the unit last.

    Args:
        estimate: of the recording.
        recording: with its reference.
        metrics: names of those to compute, or ["all"]; empty: those that are cheap.
        burn_in_s: errors count from this time on [s].

    Raises:
        JerkbenchError: a metric is unknown, or nothing counts.
    """
    from jerkbench.evaluation.evaluated_run import evaluate_run

    chosen = [plugins.create("metric", {"name": name}) for name in metric_names(list(metrics))]
    return {**evaluate_run(estimate, recording, burn_in_s, chosen), **recording.parameters}


def figure(recording: Recording, estimates: Mapping[str, Estimate], kind: str = "errors") -> "Figure":
    """Return a figure of estimates by name: their ``errors`` over time, or the ``trajectory``.

    Raises:
        JerkbenchError: there is no such kind of figure.
    """
    from jerkbench.report.plots.runs import error_figure, trajectory_figure

    kinds: dict[str, Callable[..., Figure]] = {"errors": error_figure, "trajectory": trajectory_figure}
    require_known("kind of figure", kind, kinds, JerkbenchError)
    return kinds[kind](recording, dict(estimates))
