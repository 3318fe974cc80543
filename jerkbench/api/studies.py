"""Many combinations from plain names: a study, its table, its report."""

import itertools
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench import plugins
from jerkbench.api.combination import listed
from jerkbench.errors import PluginError
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.names import Part, job_of_parts
from jerkbench.notices import notify

if TYPE_CHECKING:
    from jerkbench.report.tables.table_model import Table
    from jerkbench.results.study import Study

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
    tags: Sequence[str] = (),
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
        tags: words of your own for these cells; the rows have them.
        workers: number of processes.

    Raises:
        JerkbenchError: something is unknown or does not fit, or every combination was left out.
    """
    from jerkbench.results.manifest import write_manifest
    from jerkbench.results.study import Study, load_study, write_study

    axes = {"dataset": dataset, "attitude": attitude, "filter": filter, "adaptation": adaptation, "engine": [engine]}
    protocol = Protocol(seeds=seeds, first_seed=first_seed, burn_in_s=burn_in_s)
    ran = _run(_jobs({**axes, "disturbance": disturbance, "noise": noise}, protocol, metrics), Path(folder), workers)
    write_manifest(Path(folder), ran, list(notes), sys.argv, tags=tags)
    write_study(load_study(Path(folder), prefer=list(ran)))
    return Study.open(folder)


def _run(jobs: Iterator[Job], folder: Path, workers: int) -> dict[str, Sequence[int]]:
    """Run those of the jobs that make sense and are not done; returns the seeds of all that make sense, by key."""
    from jerkbench.jobs.cluster import Workers
    from jerkbench.jobs.plan import planned
    from jerkbench.jobs.run import run_missing
    from jerkbench.results.store import Store

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
    from jerkbench.report.analysis.runs import parse_baseline
    from jerkbench.report.tables.summary import main_metric, summarise

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
    from jerkbench.jobs.pool import processors
    from jerkbench.report.choice import figures_choice
    from jerkbench.results.replay import tell_left_out
    from jerkbench.results.study_figures import REPORT, Request, draw_study, write_report

    opened = _opened(study)
    written = Path(path) if path else opened.folder / REPORT
    request = Request(figures_choice(figures), scenarios, run_programs=run_programs)
    workers = 1 if plugins.any_of_script() else processors()
    tell_left_out(opened, run_programs=run_programs)
    write_report(opened, draw_study(opened, request, workers), written)
    return written


def _opened(study: "Study | Path | str") -> "Study":
    from jerkbench.results.study import Study

    return Study.open(study) if isinstance(study, Path | str) else study


def _jobs(axes: dict[str, Parts], protocol: Protocol, metrics: Sequence[str]) -> Iterator[Job]:
    for values in itertools.product(*map(listed, axes.values())):
        parts = dict(zip(axes, values, strict=True))
        disturbance, noise = parts.pop("disturbance"), parts.pop("noise")
        yield job_of_parts(parts, [] if disturbance is None else listed(disturbance), noise, protocol, metrics)
