"""The Python API.

Run combinations by name, and compare them in a table::

    from jerkbench import api

    rows = api.run(filter="jerk", adaptation="mtf", seeds=3)                            # a DataFrame
    study = api.sweep("results/mine", filter=["baseline", "jerk"], adaptation=["none", "mtf"])
    print(api.table(study, baseline="adaptation=none"))                                 # Markdown; HTML in a notebook
    api.report(study)

Run the steps of one combination separately::

    recording = api.disturb(api.load("field", seed=1), "gnss_outage", seed=1)           # Recording
    estimate = api.estimate(recording, filter={"name": "jerk", "accel_mps2": 0.2})      # Estimate
    values = api.evaluate(estimate, recording)                                          # {"position_rmse_m": ...}
    api.figure(recording, {"jerk": estimate}).savefig("errors.png")

A part of a combination is the name of a plugin or preset, a mapping {"name": ..., parameter: value}, or an instance of
a plugin. Omitted parts have the same defaults as in `jerkbench run` (conf/config.yaml).
"""

import dataclasses
import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError, notify, require_known
from jerkbench.estimate import Estimate
from jerkbench.jobs.job import Job, Protocol, metric_names, replaced
from jerkbench.jobs.names import Part, choose, is_plugin, job_of_parts, noise_of, plugin_of, require_sensible
from jerkbench.recording import Recording

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from jerkbench.jobs.study import Study
    from jerkbench.report.table_model import Table

__all__ = [
    "Part",
    "configuration",
    "disturb",
    "estimate",
    "evaluate",
    "figure",
    "load",
    "report",
    "run",
    "sweep",
    "table",
]


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
    """Run one combination of plugins, and return a data frame with one row for each seed.

    The columns are the factors, the seed, the status, the reason for a failure, and the metrics. The command
    `jerkbench run` computes the same rows from the same names and parameters.

    Args:
        dataset: Source of the recordings.
        disturbance: One disturbance, or several disturbances that are applied in order.
        attitude: Attitude filter. The default is the attitude filter that the data set prefers (for example the preset
            `real` for the data set `rtklib`), or `field` for a data set without a preference.
        filter: Kinematic filter or estimator.
        adaptation: Rule that adapts the measurement covariance R.
        noise: Process noise that replaces the defaults of the filter: a preset, or {"accel_mps2": ...}.
        engine: Engine that runs a kinematic filter.
        seeds: Number of seeds. The number has no effect if neither the data set nor a disturbance is random.
        first_seed: Seed of the first run. The other runs use the following integers.
        burn_in_s: Time at the start of the recording that the metrics do not evaluate [s].
        metrics: Names of the metrics to compute, or ["all"]. The default is every metric of jerkbench that does not set
            ``default = False``.
        r_scale: Factors by which the reported R is multiplied, for example {"position": 2.0, "velocity": 0.5}. By
            default, R is not scaled.

    Raises:
        JerkbenchError: A name is unknown, or the parts are not compatible. A run that fails does not
            raise an exception: the status in its row is "failed".
    """
    import pandas as pd

    from jerkbench.jobs.rows import job_rows

    single = {"dataset": dataset, "attitude": attitude, "filter": filter, "adaptation": adaptation, "engine": engine}
    protocol = Protocol(seeds=seeds, first_seed=first_seed, burn_in_s=burn_in_s)
    job = job_of_parts(single, _listed(disturbance), noise, protocol, metrics, r_scale)
    require_sensible(job)
    rows, _ = job_rows(job)
    return pd.DataFrame(rows)


def configuration(overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Return the configuration that `jerkbench run` composes from its arguments, as plain data.

    The value of each group (for example "dataset") is an argument of the function that runs this step::

        config = configuration(["--config-dir=mine", "experiment=drive", "filter=jerk"])
        recording = load(config["dataset"])
        solution = estimate(recording, filter=config["filter"], attitude=config["attitude"])

    Args:
        overrides: Arguments of `jerkbench run`: GROUP=NAME, KEY=VALUE and --config-dir=DIR.

    Raises:
        JerkbenchError: An override is unknown or has a wrong type, or an option is invalid.
    """
    from jerkbench.hydra_app.composition import composed
    from jerkbench.presets import take_folders

    return composed(take_folders(overrides)).plain


def _listed(parts: Part | Sequence[Part] | None) -> list[Part]:
    return list(parts) if isinstance(parts, list | tuple) else [parts]


Parts = Part | Sequence[Part] | None
"""One part of a combination, or a sequence of parts. A sweep runs every combination of the parts."""


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
    """Run every combination of the parts like `jerkbench run -m`, and store the results in ``folder``.

    The arguments from ``dataset`` to ``noise`` accept one part, as in `run`, or a list of parts. A list inside the list
    of disturbances is one combination of disturbances, which are applied in order. Stored runs are not computed again.
    With several ``workers``, user plugins must be defined in a module that the script or notebook imports.

    Args:
        folder: Folder of the study.
        dataset: One data set, or several data sets.
        disturbance: One disturbance, or several disturbances and combinations of disturbances.
        attitude: One attitude filter, or several attitude filters.
        filter: One kinematic filter or estimator, or several filters and estimators.
        adaptation: One adaptation, or several adaptations.
        noise: One setting of the process noise, or several settings.
        engine: Engine that runs the kinematic filters.
        seeds: Number of seeds. The number has no effect if neither the data set nor a disturbance is random.
        first_seed: Seed of the first run. The other runs use the following integers.
        burn_in_s: Time at the start of the recording that the metrics do not evaluate [s].
        metrics: Names of the metrics to compute, with the same default as in `run`.
        notes: Notes that are printed below the tables.
        workers: Number of processes.

    Raises:
        JerkbenchError: A name is unknown, the parts are not compatible, or no combination can run.
    """
    from jerkbench.jobs.executors import Workers
    from jerkbench.jobs.plan import planned
    from jerkbench.jobs.run import run_missing
    from jerkbench.jobs.store import Store
    from jerkbench.jobs.study import concluded

    axes = {"dataset": dataset, "attitude": attitude, "filter": filter, "adaptation": adaptation, "engine": [engine]}
    protocol = Protocol(seeds=seeds, first_seed=first_seed, burn_in_s=burn_in_s)
    plan = planned(_jobs({**axes, "disturbance": disturbance, "noise": noise}, protocol, metrics))
    for message in plan.refused:
        notify(message)
    if not plan.jobs:
        raise PluginError("There is nothing to run: every combination was left out.")
    if workers > 1:
        _require_modules(plan.jobs)
    with Workers(count=workers) as executor:
        run_missing(plan, Store(Path(folder)), executor)
    study, _ = concluded(Path(folder), plan.draws, list(notes), sys.argv)
    return study


def _require_modules(jobs: Iterable[Job]) -> None:
    """Reject plugins that are defined in the script itself, because other processes cannot import them."""
    for job in jobs:
        for _, _, plugin in job.parts():
            if plugins.of_script(type(plugin)):
                where = f"{type(plugin).__name__} is defined in the script itself, so other processes cannot import it"
                raise PluginError(f"{where}; give workers=1, or move the class into a module that the script imports.")


def table(
    study: "Study | Path | str",
    metric: str | None = None,
    rows: Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
    baseline: str | None = None,
) -> "Table":
    """Return a table of the results of a study. The table prints as Markdown, and notebooks show the table as HTML.

    Args:
        study: The study or its folder.
        metric: Column of rows.csv. The default is position_rmse_m, or the first metric if the study has no column
            position_rmse_m.
        rows: Factors whose values are the rows of the table. By default, all factors that vary and are not in
            ``columns``.
        columns: Factors whose values are the columns of the table. The default is the adaptation.
        baseline: A method, for example "adaptation=none". With a baseline, the table also shows ratios to this method.

    Raises:
        JerkbenchError: The study has no results, or the metric, a factor or the baseline is unknown.
    """
    from jerkbench.report.comparisons import parse_baseline
    from jerkbench.report.summary import main_metric, summarise

    opened = _opened(study)
    column = metric or main_metric(opened.rows)
    compared = parse_baseline(baseline) if baseline else None
    return summarise(opened.rows, column, rows, columns, opened.notes, baseline=compared)


def report(
    study: "Study | Path | str",
    path: Path | str | None = None,
    scenarios: int = 20,
    figures: str = "few",
    *,
    run_programs: bool = False,
) -> Path:
    """Write the report of a study as one HTML file, and return the path of the file.

    Args:
        study: The study or its folder.
        path: Path of the HTML file, by default report.html in the folder of the study.
        scenarios: Maximum number of scenarios for which figures of the runs are drawn.
        figures: Selection of the figures: "few" (three scenarios), "all" or "none".
        run_programs: Whether the report may run the external programs that the stored results name. Use True only for
            results that you trust.

    Raises:
        JerkbenchError: The study has no results.
    """
    from jerkbench.jobs.executors import processors
    from jerkbench.jobs.study import report_excluded_programs
    from jerkbench.report import figures_choice
    from jerkbench.report.study_figures import REPORT, Request, write_report

    opened = _opened(study)
    written = Path(path) if path else opened.folder / REPORT
    request = Request(figures_choice(figures), scenarios, run_programs=run_programs)
    workers = 1 if plugins.any_of_script() else processors()
    report_excluded_programs(opened, run_programs=run_programs)
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


# Functions that run one step of a combination.


def load(dataset: Part | None = None, seed: int = Protocol.first_seed) -> Recording:
    """Return the recording of a data set. A simulated recording is generated from ``seed``.

    Raises:
        JerkbenchError: The data set is unknown, its parameters are invalid, or its files cannot be read.
    """
    recording: Recording = plugin_of("dataset", dataset).load(seed)
    return recording


def disturb(recording: Recording, disturbance: Part | Sequence[Part], seed: int = Protocol.first_seed) -> Recording:
    """Return the recording after one disturbance, or after several disturbances in order.

    The random numbers of the disturbances are derived from ``seed``.

    Raises:
        JerkbenchError: A disturbance is unknown, its parameters are invalid, or the recording lacks the stream that the
            disturbance changes.
    """
    for part in _listed(disturbance):
        parts = [part] if is_plugin(part) else list(choose("disturbance", part).plain.values())
        for one in parts:
            plugin = one if is_plugin(one) else plugins.create("disturbance", one)
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
    """Run a filter over a recording, and return its estimate. The arguments have the same meaning as in `run`.

    The default attitude filter does not depend on the data set, because a recording does not store the preferred
    attitude filter of its data set. For recorded drives, ``attitude="real"`` is usually suitable.

    Raises:
        JerkbenchError: A name is unknown, the parts are not compatible, or the recording lacks an input.
    """
    from jerkbench.jobs.rows import attitude_of, solution

    model = plugin_of("filter", filter)
    model = dataclasses.replace(model, **replaced(type(model), noise_of(noise).plain))
    oriented = attitude_of(recording, plugin_of("attitude", attitude))
    return solution(recording, oriented, model, plugin_of("adaptation", adaptation), plugin_of("engine", engine))


def evaluate(
    estimate: Estimate, recording: Recording, *, metrics: Sequence[str] = (), burn_in_s: float = Protocol.burn_in_s
) -> dict[str, float]:
    """Compare an estimate with the reference of its recording, and return the metrics.

    Args:
        estimate: Estimate that a filter computed from the recording.
        recording: Recording with a reference.
        metrics: Names of the metrics to compute, or ["all"]. The default is every metric of jerkbench that does not set
            ``default = False``.
        burn_in_s: Time at the start of the recording that the metrics do not evaluate [s].

    Returns:
        The value of each metric column. The name of a column ends with its unit, for example ``position_rmse_m``.

    Raises:
        JerkbenchError: A metric is unknown, or no row of the reference can be evaluated.
    """
    from jerkbench.evaluation.evaluated_run import evaluate_run

    selected = [plugins.create("metric", {"name": name}) for name in metric_names(list(metrics))]
    return {**evaluate_run(estimate, recording, burn_in_s, selected), **recording.parameters}


def figure(recording: Recording, estimates: Mapping[str, Estimate], kind: str = "errors") -> "Figure":
    """Return a figure of one or several estimates.

    Args:
        recording: Recording with a reference.
        estimates: Mapping from the labels in the legend to the estimates.
        kind: "errors" (errors over time) or "trajectory".

    Raises:
        JerkbenchError: The kind is unknown.
    """
    from jerkbench.report.plots.runs import error_figure, trajectory_figure

    kinds: dict[str, Callable[..., Figure]] = {"errors": error_figure, "trajectory": trajectory_figure}
    require_known("kind of figure", kind, kinds, JerkbenchError)
    return kinds[kind](recording, dict(estimates))
