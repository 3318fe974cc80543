"""The Hydra application of `jerkbench run`, which plans a single run or a sweep, runs it and writes the results."""

import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import compress
from typing import Any

import hydra
from hydra.core.config_loader import ConfigLoader
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from jerkbench.campaign.split import reused_seeds
from jerkbench.errors import FAILED, INTERRUPTED, JerkbenchError, PluginError, exit_with
from jerkbench.evaluation.judgement import Verdict
from jerkbench.evaluation.planning import interim_levels, interim_sizes
from jerkbench.filters.trajectory import Command
from jerkbench.hydra_app.composition import Composed, compose_jobs
from jerkbench.hydra_app.configuration import (
    Options,
    check_options,
    cluster_of,
    configured_job,
    register_schemas,
    study_folder,
)
from jerkbench.hydra_app.overrides import arranged_overrides, ignored_combinations
from jerkbench.jobs.executors import Cluster, ClusterError, Workers, processors
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import JobSeeds, stretches
from jerkbench.jobs.names import require_sensible
from jerkbench.jobs.plan import Plan, first_complaints, first_notes, in_order, missing, planned
from jerkbench.jobs.progress import Progress, duration, pulse
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import Study, concluded, load_study
from jerkbench.presets import config_folder, search_path_overrides
from jerkbench.report import Choice, figures_choice
from jerkbench.report.comparisons import VerdictRule
from jerkbench.report.findings import study_verdicts
from jerkbench.report.labels import Labels
from jerkbench.report.summary import main_metric, summarise


def prepared_app(arguments: Sequence[str]) -> Callable[[], Any]:
    """Return a function that starts `jerkbench run` with the given arguments."""
    if {"-m", "--multirun"} & set(arguments) and {"-c", "--cfg"} & set(arguments):
        raise PluginError("--cfg shows the configuration of a single run; leave out -m and give each option one value.")
    register_schemas()
    decorate = hydra.main(version_base="1.3", config_path=str(config_folder()), config_name="config")
    app: Callable[[], Any] = decorate(run_one)
    arguments = ["dry=true" if argument == "--dry" else argument for argument in arguments]
    sys.argv = ["jerkbench run", *arranged_overrides([*search_path_overrides(), *arguments])]
    return app


def run_one(config: DictConfig) -> None:
    """Run the single job of a Hydra configuration, and print its rows."""
    task = HydraConfig.get()
    try:
        options: Any = OmegaConf.to_container(config, resolve=True)
        job = configured_job(options, task.runtime.choices, list(task.overrides.task))
        check_options(options)
        cluster_of(options)  # a single run does not use the cluster, but invalid options are still an error
        store = Store(study_folder(options))
        if ignored := ignored_combinations(task.sweeper.get("params"), task.overrides.task):
            swept = f"1 of the {ignored + 1} combinations of the experiment and ignores the other {ignored}"
            print(f"This command runs {swept}; add -m to run all combinations.", file=sys.stderr)
        require_sensible(job)
        plan = planned([job])
        reused = reused_seeds(options["notes"], plan.jobs)
        options["notes"] = [*options["notes"], *reused]
        for line in (*first_notes(plan.jobs), *reused):
            print(line, file=sys.stderr)
        if options["dry"]:
            print(*forecast(plan, store, options["max_seeds"]), sep="\n")
        else:
            _run_and_show(plan, store, options)
            if figures_choice(options["figures"]) is not Choice.NONE:
                from jerkbench.report.study_figures import draw_single

                for path in draw_single(plan.jobs[0], study_folder(options), pdf=options["figures_pdf"]):
                    print(f"Figure: {path}")
    except JerkbenchError as error:  # otherwise, Hydra prints more than the error message
        exit_with(error)


def score_files(composition: Composed, pattern: str, label: str, dataset: Mapping[str, Any] | None = None) -> None:
    """Score trajectory files, store their rows, and print them.

    Args:
        composition: The configuration with the recording, the protocol and the study.
        pattern: The path of a file, or a pattern with {seed}.
        label: The label of the method in tables, or an empty string for the name of the file.
        dataset: Additional parameters of the data set.

    Raises:
        JerkbenchError: A file cannot be scored, and therefore no row is stored.
    """
    job = composition.job(dataset or {}, file=pattern, label=label)
    require_sensible(job)
    folder = study_folder(composition.plain)
    _run_and_show(planned([job]), Store(folder), composition.plain)
    print(f"\nRows, tables and manifest: {folder}")


def _run_and_show(plan: Plan, store: Store, options: Options) -> None:
    """Run one job, print its rows and notes, and then write the tables of the study, which takes longer."""
    from jerkbench.report.terminal import print_run

    with pulse(lambda seconds: f"Running for {duration(seconds)}."):
        run_missing(plan, store, strict=True, progress=Progress(0), threads=os.cpu_count() or 1)
    (stored,), _ = store.read(plan.draws, {key: stretches(draws) for key, draws in plan.draws.items()})
    print_run(stored.rows)
    for note in stored.metadata["notes"]:
        print(note, flush=True)
    concluded(study_folder(options), plan.draws, list(options["notes"]), sys.argv)


def forecast(plan: Plan, store: Store, max_seeds: int) -> Iterator[str]:
    """Yield lines with the state of each combination, the combinations that are left out, and the number of runs."""
    known = store.known(plan.draws)
    left = {job.key: len(missing(job, known.get(job.key, ()))) for job in plan.jobs}
    differing = [len(set(values)) > 1 for values in zip(*(job.labels for job in plan.jobs), strict=True)]
    shown = differing if any(differing) else [True] * len(differing)  # a single combination is shown with all labels
    named = map(" ".join, zip(Labels._fields, plan.jobs[0].labels, strict=True))
    if same := list(compress(named, (not differs for differs in shown))):
        yield f"In all combinations: {', '.join(same)}."
    yield f"{', '.join(compress(Labels._fields, shown))}:"
    for job in plan.jobs:
        state = _count(left[job.key], "run") if left[job.key] else "complete"
        yield f"  {', '.join(compress(job.labels, shown))}: {state}"
    yield from plan.refused
    runs, done = sum(left.values()), list(left.values()).count(0)
    yield f"{_count(len(plan.jobs), 'combination')}, {done} complete; {_count(runs, 'run')} to compute."
    if max_seeds:
        yield f"These runs are the first interim analysis. Undecided comparisons get more seeds, at most {max_seeds}."


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


def launch(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> None:
    """Run all jobs of a sweep and print the table.

    After a failure or Ctrl-C, the rows of the finished runs are printed.

    Raises:
        SystemExit: A run failed, or the sweep was interrupted.
    """
    plan, cluster = _planned(loader, config, jobs)
    store = Store(study_folder(config))
    if config.dry:
        print(*forecast(plan, store, config.max_seeds), sep="\n")
        return
    analyses = remaining_analyses(plan, config.seeds, config.max_seeds, store)
    code, (plan, level) = 0, analyses[0]
    try:
        with Workers(cluster, config.workers or processors()) as workers:
            for plan, level in analyses:
                run_missing(plan, store, workers)
                if plan is analyses[-1][0] or not undecided(load_study(store.folder.parent, plan.draws), level):
                    break
    except (KeyboardInterrupt, OSError, JerkbenchError) as error:
        code = report_end(error)
    if code := conclude_sweep(plan, level if config.max_seeds else None, code, store, config):
        raise SystemExit(code)


def _planned(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> tuple[Plan, Cluster]:
    """Compose and plan the jobs of a sweep. Print warnings and the combinations that are left out on standard error."""
    with pulse(lambda seconds: f"Planning {len(jobs)} combinations for {duration(seconds)}."):
        composed = compose_jobs(loader, config, jobs)
        config.notes = list(dict.fromkeys(note for job in composed for note in job.plain["notes"]))
        plan = planned(job.job() for job in composed)
    reused = reused_seeds(config.notes, plan.jobs)
    config.notes = [*config.notes, *reused]
    for line in (*plan.refused, *first_complaints(plan.jobs), *first_notes(plan.jobs), *reused):
        print(line, file=sys.stderr)
    if not plan.jobs:
        exit_with(PluginError("There is nothing to run, because every combination was left out."))
    return plan, cluster_of(config)


def remaining_analyses(plan: Plan, first: int, maximum: int, store: Store) -> list[tuple[Plan, float]]:
    """Return the interim analyses from the last analysis whose runs are all stored, or else from the first analysis.

    An analysis consists of a plan, which includes the runs of all earlier analyses, and of a significance level. The
    significance levels divide the error probability of 5 % of the study between the analyses.
    """
    sizes, plans = [first], [plan]
    if maximum > first and any(job.scenario.seeded for job in plan.jobs):
        sizes = interim_sizes(maximum, first)
        plans = [Plan(tuple(_with_seeds(job, size) for job in plan.jobs), plan.refused) for size in sizes]
    known = store.known(plans[-1].draws)
    done = [not any(missing(job, known.get(job.key, ())) for job in part.jobs) for part in plans]
    start = max((k for k, complete in enumerate(done) if complete), default=0)
    return list(zip(plans, map(float, interim_levels(sizes)), strict=True))[start:]


def undecided(study: Study, level: float) -> int:
    """Return the number of pairs of methods whose comparison by the main metric of the study is undecided."""
    verdicts = study_verdicts(study.rows, main_metric(study.rows), rule=VerdictRule(level=level))
    return sum(pair.verdict is Verdict.UNDECIDED for standing in verdicts.standings for pair in standing.comparisons)


def _with_seeds(job: Job, seeds: int) -> Job:
    if not job.scenario.seeded:
        return job
    draws = {seed for first, _ in stretches(job.draws) for seed in range(first, first + seeds)}
    return replace(job, draws=in_order(draws))


def report_end(error: KeyboardInterrupt | OSError | JerkbenchError) -> int:
    """Print why a sweep ended early, and return the exit code.

    If the input is invalid, the program exits immediately.
    """
    if isinstance(error, KeyboardInterrupt):
        print("Interrupted. Finished runs are stored; the same command continues the sweep.", file=sys.stderr)
        return INTERRUPTED
    if isinstance(error, ClusterError | ChildProcessError):
        print(f"jerkbench: the sweep was stopped: {error}", file=sys.stderr)
    elif isinstance(error, OSError):
        print(f"jerkbench: the sweep was stopped, because a result cannot be stored: {error}.", file=sys.stderr)
    else:
        exit_with(error)
    return FAILED


def conclude_sweep(plan: Plan, level: float | None, code: int, store: Store, config: DictConfig) -> int:
    """Write and print the results of a sweep, and return the exit code.

    Args:
        plan: The plan with the jobs of the sweep.
        level: The significance level of the last interim analysis, or None if seeds were not added in blocks.
        code: The exit code of the runs, which is not 0 if the runs ended early.
        store: The store of the results.
        config: The configuration of the sweep.

    Returns:
        The exit code of the command.
    """
    known = store.known(plan.draws, failed=True)
    missing = [key for key, draws in plan.draws.items() if not known.get(key, set()).issuperset(draws)]
    study = None
    if len(missing) < len(plan.jobs):
        seeds = {key: () if key in missing else draws for key, draws in plan.draws.items()}
        try:
            study = _write_and_print(store, seeds, config, level)
        except OSError as error:
            print(f"jerkbench: the tables cannot be written: {error}. Finished runs are stored.", file=sys.stderr)
            return FAILED
    if study is not None and not code and config.report:
        code = _reported(study, config, run_programs=any(isinstance(job.method.filter, Command) for job in plan.jobs))
    if not code and missing:
        print(
            f"jerkbench: the results of {len(missing)} of {len(plan.jobs)} combinations are missing in {store.folder}:"
            " files were deleted or damaged after the runs. The same command computes these results again.",
            file=sys.stderr,
        )
        return FAILED
    return code or (FAILED if study is not None and (study.rows["status"] == "failed").any() else 0)


def _write_and_print(store: Store, seeds: JobSeeds, config: DictConfig, level: float | None) -> Study:
    """Write the tables of a study, print the table of the jobs in ``seeds``, and return the study of these jobs."""
    from jerkbench.report.terminal import MAX_ROWS, print_table

    store.compact()
    study, table = concluded(store.folder.parent, seeds, list(config.notes), sys.argv, level)
    shown = study.only(seeds)
    if len(shown.rows) < len(study.rows):
        table = summarise(shown.rows, main_metric(shown.rows), notes=shown.notes)
    print_table(table, f"jerkbench table {shlex.quote(str(study.folder))} --notes", max_rows=MAX_ROWS)
    print(f"\nRows, tables and manifest: {store.folder.parent}", flush=True)
    return shown


def _reported(study: Study, config: DictConfig, *, run_programs: bool) -> int:
    """Draw the figures of a study, write its report, and return the exit code."""
    from jerkbench.report.study_figures import present

    try:
        choice = figures_choice(config.figures)
        present(study, config.workers or processors(), choice, pdf=config.figures_pdf, run_programs=run_programs)
    except (KeyboardInterrupt, OSError) as error:
        reason = f": {error}" if str(error) else ""
        message = f"The results are complete, but the report is not{reason}"
        print(f"{message}. For a report: jerkbench report {study.folder}", file=sys.stderr)
        return INTERRUPTED if isinstance(error, KeyboardInterrupt) else FAILED
    return 0
