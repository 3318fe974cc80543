"""A sweep of our own launcher: planned, run, concluded."""

import sys
from collections.abc import Sequence

from hydra.core.config_loader import ConfigLoader
from hydra.core.utils import JobReturn, JobStatus
from omegaconf import DictConfig

from jerkbench.clusters.cluster import Cluster, ClusterError
from jerkbench.errors import INTERRUPTED, JerkbenchError, PluginError, exit_with
from jerkbench.execution.data_mistakes import first_mistakes
from jerkbench.execution.inputs import shared_inputs
from jerkbench.execution.notes import first_remarks
from jerkbench.execution.plugin_errors import first_complaints
from jerkbench.execution.processors import processors
from jerkbench.execution.pulse import Pulse, duration
from jerkbench.filters.command import Command
from jerkbench.hydra_app.composition import compose_jobs
from jerkbench.hydra_app.conclusion import FAILED, conclude, draw_and_report, failed, lost
from jerkbench.hydra_app.configuration import cell_of, study_folder
from jerkbench.hydra_app.dry_run import tell
from jerkbench.hydra_app.interruption import terminated_like_interrupted
from jerkbench.hydra_app.words import cluster_of
from jerkbench.results.store import Store
from jerkbench.results.study import load_study
from jerkbench.sweep.auto_seeds import planned_looks, run_looks
from jerkbench.sweep.sweep import Plan, plan_sweep, run_sweep


def sweep(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> list[JobReturn]:
    """Run all jobs of a sweep, and end with the table, also after a failure or Ctrl-C.

    Raises:
        SystemExit: a run failed, or the sweep was interrupted.
    """
    plan, cluster = _planned(loader, config, jobs)
    store = Store(study_folder(config))
    if config.dry:
        tell(plan, store, config)
    elif code := _finished(plan, store, config, cluster):
        raise SystemExit(code)
    return [JobReturn(status=JobStatus.COMPLETED) for _ in jobs]


def _planned(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> tuple[Plan, Cluster]:
    """The cells of a sweep, and where they run; says what is left out, and what is to be known of the rest."""
    try:
        with Pulse(lambda seconds: f"Planning {len(jobs)} combinations for {duration(seconds)}."):
            composed = compose_jobs(loader, config, jobs)
            plan = plan_sweep([cell_of(job.plain, job.choices, job.overrides) for job in composed])
        cluster = cluster_of(config)
    except JerkbenchError as error:
        exit_with(error)
    for line in (
        *plan.refused,
        *first_complaints(planned.cell for planned in plan.cells),
        *first_mistakes((planned.cell for planned in plan.cells), shared_inputs()),
        *first_remarks(((planned.cell, planned.fingerprint) for planned in plan.cells), shared_inputs()),
    ):
        print(line, file=sys.stderr)
    if not plan.cells:
        exit_with(PluginError("There is nothing to run: every combination was left out."))
    return plan, cluster


def _finished(plan: Plan, store: Store, config: DictConfig, cluster: Cluster) -> int:
    """Run the plan, with as many seeds as are asked for, and conclude; returns the exit code."""
    last, code = run_looks(
        planned_looks(plan, config.seeds, config.max_seeds),
        store,
        lambda plan: run_plan(plan, store, config.workers or processors(), cluster),
        lambda look: load_study(store.folder.parent, list(look.plan.draws), look.plan.draws),
    )
    seeds = last.plan.draws
    try:
        study = conclude(store, seeds, config, last.level if config.max_seeds else None)
    except OSError as error:
        print(f"jerkbench: the tables cannot be written: {error}. What is done is stored.", file=sys.stderr)
        return FAILED
    if study is not None and not code:
        asked = any(isinstance(planned.cell.filter, Command) for planned in last.plan.cells)
        code = draw_and_report(study, config, run_programs=asked)
    return code or failed(study) or lost(store, seeds)


def run_plan(plan: Plan, store: Store, workers: int, cluster: Cluster) -> int:
    """Run the plan; returns the exit code of a sweep that did not come to its end, or 0."""
    try:
        with terminated_like_interrupted():
            run_sweep(plan, store, workers, cluster)
    except KeyboardInterrupt:
        print("Interrupted. What is done is stored; the same command goes on from there.", file=sys.stderr)
        return INTERRUPTED
    except (ClusterError, ChildProcessError) as error:
        print(f"jerkbench: the sweep ends here: {error}", file=sys.stderr)
        return FAILED
    except OSError as error:
        print(f"jerkbench: the sweep ends here, because a result cannot be stored: {error}.", file=sys.stderr)
        return FAILED
    except JerkbenchError as error:
        exit_with(error)
    return 0
