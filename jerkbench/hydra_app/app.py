"""The Hydra app behind `jerkbench run`: one job, or a sweep of many, planned, run and concluded."""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import hydra
from hydra.core.config_loader import ConfigLoader
from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import JobReturn, JobStatus
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from jerkbench.campaign.split import reused_seeds
from jerkbench.contracts import Estimator
from jerkbench.errors import INTERRUPTED, JerkbenchError, PluginError, exit_with
from jerkbench.filters.command import Command
from jerkbench.hydra_app.composition import Composed, compose_jobs
from jerkbench.hydra_app.configuration import (
    LAUNCHER,
    Options,
    check_options,
    cluster_of,
    configured_job,
    register_schemas,
    study_folder,
)
from jerkbench.hydra_app.looks import forecast, looks_left, undecided
from jerkbench.hydra_app.overrides import arranged_words, ignored_combinations
from jerkbench.jobs.executors import LOCAL, Cluster, ClusterError, Workers, processors
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.manifest import stretches
from jerkbench.jobs.names import refusal, require_sensible
from jerkbench.jobs.plan import Plan, planned
from jerkbench.jobs.preflight import first_complaints, first_remarks
from jerkbench.jobs.progress import Progress, duration, pulse
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import Study, concluded, load_study
from jerkbench.presets import config_folder, folder_words
from jerkbench.report import Choice, figures_choice


def prepared_app(arguments: Sequence[str]) -> Callable[[], Any]:
    """Return the app for the command line ``arguments``; it runs when it is called."""
    if {"-m", "--multirun"} & set(arguments) and {"-c", "--cfg"} & set(arguments):
        raise PluginError("--cfg shows the configuration of one run: leave out -m, and give each option one value.")
    register_schemas()
    app: Callable[[], Any] = hydra.main(version_base="1.3", config_path=str(config_folder()), config_name="config")(one)
    arguments = ["dry=true" if word == "--dry" else word for word in arguments]
    sys.argv = ["jerkbench run", *arranged_words([*folder_words(), *arguments])]
    return app


def one(config: DictConfig) -> None:
    """Run one job: a single run, or one combination of a sweep that another launcher has started."""
    task = HydraConfig.get()
    try:
        options: Any = OmegaConf.to_container(config, resolve=True)
        job = configured_job(options, task.runtime.choices, list(task.overrides.task))
        check_options(options)
        cluster_of(options)  # not needed here, but its options are checked
        sweeping, store = task.mode == RunMode.MULTIRUN, Store(study_folder(options))
        if not sweeping and (ignored := ignored_combinations(task.sweeper.get("params"), task.overrides.task)):
            swept = f"1 of the {ignored + 1} combinations of values that the experiment sweeps, and ignores {ignored}"
            print(f"This command runs {swept}; add -m to run all of them.", file=sys.stderr)
        if (reason := refusal(job)) and sweeping:
            print(f"Left out: {reason}.", file=sys.stderr)
            return
        require_sensible(job)
        plan = planned([job])
        for line in (*first_remarks(plan.jobs, shared_inputs()), *reused_seeds(options["notes"], plan.jobs)):
            print(line, file=sys.stderr)
        if options["dry"]:
            tell(plan, store, options)
        elif sweeping:
            run_missing(plan, store, progress=Progress(0))
        else:
            _run_single(plan, store, options)
    except JerkbenchError as error:  # Hydra would print more than the message
        exit_with(error)


def _run_single(plan: Plan, store: Store, options: Options) -> None:
    drawing = figures_choice(options["figures"]) is not Choice.NONE
    method = plan.jobs[0].method
    if drawing and hasattr(method.engine, "prepare") and not isinstance(method.filter, Estimator):
        method.engine.prepare(method.filter)  # the loop for trajectories, which takes as long as all else to compile
    _run_and_show(plan, store, options)
    if drawing:
        from jerkbench.report.study_figures import draw_single

        for path in draw_single(plan.jobs[0], study_folder(options), pdf=options["figures_pdf"]):
            print(f"Figure: {path}")


def score_files(words: Composed, pattern: str, label: str, dataset: Mapping[str, Any] | None = None) -> None:
    """Score the files of ``pattern``, store their rows, and print them.

    Args:
        words: the recording, the protocol and the study.
        pattern: a file, or one for each seed.
        label: what tables call the method; empty: the file's name.
        dataset: parameters of the data set beside its words.

    Raises:
        JerkbenchError: a file cannot be scored; nothing is stored then.
    """
    job = words.job(dataset or {}, file=pattern, label=label)
    require_sensible(job)
    folder = study_folder(words.plain)
    _run_and_show(planned([job]), Store(folder), words.plain)
    print(f"\nRows, tables and manifest: {folder}")


def _run_and_show(plan: Plan, store: Store, options: Options) -> None:
    """Run one job and print its rows and notes at once, because files and figures take longer; then write the study."""
    from jerkbench.report.terminal import print_run

    with pulse(lambda seconds: f"Running for {duration(seconds)}."):
        run_missing(plan, store, strict=True, progress=Progress(0), threads=os.cpu_count() or 1)
    (stored,), _ = store.read(plan.draws, {key: stretches(own) for key, own in plan.draws.items()})
    print_run(stored.rows)
    for note in stored.metadata["notes"]:
        print(note, flush=True)
    concluded(study_folder(options), plan.draws, list(options["notes"]), sys.argv)


def tell(plan: Plan, store: Store, options: Options) -> None:
    """Print what would run, and for how long."""
    for line in forecast(plan, store, options["workers"] or processors()):
        print(line)
    if maximum := options["max_seeds"]:
        print(f"That is the first look; seeds are added up to {maximum} where a comparison is undecided.")


def launch(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> list[JobReturn]:
    """Run all jobs of a sweep, and end with the table, also after a failure or Ctrl-C.

    Raises:
        SystemExit: a run failed, or the sweep was interrupted.
    """
    plan, cluster = _planned(loader, config, jobs)
    store = Store(study_folder(config))
    if config.dry:
        tell(plan, store, config)
        return [JobReturn(status=JobStatus.COMPLETED) for _ in jobs]
    every = looks_left(plan, config.seeds, config.max_seeds, store)
    code, (plan, level) = 0, every[0]
    try:
        with Workers(cluster, config.workers or processors()) as workers:
            for plan, level in every:
                run_missing(plan, store, workers)
                if plan is every[-1][0] or not undecided(load_study(store.folder.parent, plan.draws), level):
                    break
    except (KeyboardInterrupt, OSError, JerkbenchError) as error:
        code = ended_by(error)
    if code := _concluded(plan, level if config.max_seeds else None, code, store, config):
        raise SystemExit(code)
    return [JobReturn(status=JobStatus.COMPLETED) for _ in jobs]


def _planned(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> tuple[Plan, Cluster]:
    """The cells of a sweep, and where they run; says what is left out, and what is to be known of the rest."""
    with pulse(lambda seconds: f"Planning {len(jobs)} combinations for {duration(seconds)}."):
        composed = compose_jobs(loader, config, jobs)
        config.notes = list(dict.fromkeys(note for job in composed for note in job.plain["notes"]))
        plan = planned(job.job() for job in composed)
    cluster = cluster_of(config)
    remarks = (*first_remarks(plan.jobs, shared_inputs()), *reused_seeds(config.notes, plan.jobs))
    for line in (*plan.refused, *first_complaints(plan.jobs), *remarks):
        print(line, file=sys.stderr)
    if not plan.jobs:
        exit_with(PluginError("There is nothing to run: every combination was left out."))
    return plan, cluster


FAILED = 1
"""Exit code of a sweep of which a run failed."""


def ended_by(error: KeyboardInterrupt | OSError | JerkbenchError) -> int:
    """Say why a sweep does not come to its end, and return its exit code; an input at fault ends the command."""
    if isinstance(error, KeyboardInterrupt):
        print("Interrupted. What is done is stored; the same command goes on from there.", file=sys.stderr)
        return INTERRUPTED
    if isinstance(error, ClusterError | ChildProcessError):
        print(f"jerkbench: the sweep ends here: {error}", file=sys.stderr)
    elif isinstance(error, OSError):
        print(f"jerkbench: the sweep ends here, because a result cannot be stored: {error}.", file=sys.stderr)
    else:
        exit_with(error)
    return FAILED


def _concluded(plan: Plan, level: float | None, code: int, store: Store, config: DictConfig) -> int:
    """Write and print the results of a sweep that ended with ``code``; returns its exit code."""
    try:
        study = conclude_study(store, plan.draws, config, level)
    except OSError as error:
        print(f"jerkbench: the tables cannot be written: {error}. What is done is stored.", file=sys.stderr)
        return FAILED
    if study is not None and not code:
        asked = any(isinstance(job.method.filter, Command) for job in plan.jobs)
        code = draw_and_report(study, config, run_programs=asked)
    if not code and (gone := _incomplete(store, plan.draws)):
        print(
            f"jerkbench: {len(gone)} of {len(plan.jobs)} cells are not in {store.folder}, although they have run:"
            " somebody has deleted or damaged their files. The same command runs them again.",
            file=sys.stderr,
        )
        return FAILED
    return code or (failed_code(study) if study else 0)


def conclude_study(
    store: Store, seeds: Mapping[str, Sequence[int]], config: DictConfig, level: float | None = None
) -> Study | None:
    """Write and print the tables of a study.

    Args:
        store: of the study.
        seeds: the seeds of the jobs that were run; empty: all jobs that are stored.
        config: the configuration.
        level: significance level of the last interim analysis.

    Returns:
        The jobs that were run. None: no job is complete.
    """
    from jerkbench.report.terminal import print_beginning, print_table

    folder = store.folder.parent
    gone = _incomplete(store, seeds)
    if seeds and len(gone) == len(seeds):
        return None
    store.compact()
    there = {key: () if key in gone else own for key, own in seeds.items()}
    study, table = concluded(folder, there, list(config.notes), sys.argv, level)
    shown = study.only(seeds) if seeds else study
    if len(shown.rows) == len(study.rows):
        print_beginning(table)
    else:
        print_table(shown.rows, shown.notes)
    print(f"\nRows, tables and manifest: {folder}", flush=True)
    return shown


def draw_and_report(study: Study, config: DictConfig, *, run_programs: bool = False) -> int:
    """Draw the figures and write the report where they are asked for; returns the exit code, or 0.

    Args:
        study: the study.
        config: the configuration.
        run_programs: whether the command itself has asked for a program; those of cells found in the folder are a
            stranger's.
    """
    if not config.report:
        return 0
    from jerkbench.report.study_figures import present

    try:
        choice = figures_choice(config.figures)
        present(study, config.workers or processors(), choice, pdf=config.figures_pdf, run_programs=run_programs)
    except KeyboardInterrupt:
        print(f"Interrupted. The results are complete; `jerkbench report {study.folder}` draws again.", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        print(f"jerkbench: the figures and the report cannot be written: {error}. The results are.", file=sys.stderr)
        return FAILED
    return 0


def failed_code(study: Study) -> int:
    """Return the exit code for a study: not 0 if one of its runs failed."""
    return FAILED if (study.rows["status"] == "failed").any() else 0


def _incomplete(store: Store, seeds: Mapping[str, Sequence[int]]) -> list[str]:
    """Return the jobs of which a run is neither done nor failed."""
    known = store.known(seeds, failed=True)
    return [key for key, own in seeds.items() if not known.get(key, set()).issuperset(own)]


class Conclude(Callback):
    """Writes the table after a sweep that another launcher has run."""

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:  # noqa: ANN401 - Hydra's signature
        """Write and print the table of all that is stored; exits as the built-in launcher would."""
        if config.hydra.launcher["_target_"] == LAUNCHER or config.dry:
            return
        if config.max_seeds or cluster_of(config) != LOCAL:
            print("cluster= and max_seeds= have no effect with another launcher.", file=sys.stderr)
        try:
            study = conclude_study(Store(study_folder(config)), {}, config)
        except JerkbenchError as error:  # Hydra would log more than the message
            exit_with(error)
        if study and (code := draw_and_report(study, config) or failed_code(study)):
            raise SystemExit(code)
