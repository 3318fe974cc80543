"""A sweep of our own launcher: planned, run, concluded; and what a sweep of another launcher needs of it."""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from hydra.core.config_loader import ConfigLoader
from hydra.core.utils import JobReturn, JobStatus
from omegaconf import DictConfig

from jerkbench.errors import INTERRUPTED, JerkbenchError, PluginError, exit_with
from jerkbench.files import write_text
from jerkbench.filters.command import Command
from jerkbench.hydra_app.composition import compose_jobs
from jerkbench.hydra_app.configuration import configured_job, study_folder
from jerkbench.hydra_app.looks import Look, forecast, looks_left, planned_looks, undecided
from jerkbench.hydra_app.words import cluster_of
from jerkbench.jobs.cluster import Cluster, ClusterError, Workers, processors
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.jobs.plan import Plan, planned
from jerkbench.jobs.preflight import first_complaints, first_remarks
from jerkbench.jobs.progress import Pulse, duration
from jerkbench.jobs.run import run_missing
from jerkbench.report import figures_choice
from jerkbench.results.store import Store
from jerkbench.results.study import Study, concluded, load_study

# The end of a sweep: manifest, tables, figures, report, and the exit code that they come to.

FAILED = 1
"""Exit code of a sweep of which a run failed."""


def conclude_study(
    store: Store, seeds: Mapping[str, Sequence[int]], config: DictConfig, level: float | None = None
) -> Study | None:
    """Write and print the tables of what is there; returns the cells that were run, or nothing where none is whole."""
    from jerkbench.report.tables.terminal import print_beginning, print_table

    folder = store.folder.parent
    gone = _not_whole(store, seeds)
    if len(gone) == len(seeds):
        return None
    store.compact()
    there = {key: () if key in gone else own for key, own in seeds.items()}
    study, table = concluded(folder, there, list(config.notes), sys.argv, level, list(config.tags))
    shown = study.only(seeds)
    if len(shown.rows) == len(study.rows):
        print_beginning(table)
    else:
        print_table(shown.rows, shown.notes)
    print(f"\nRows, tables and manifest: {folder}", flush=True)
    return shown


def failed_code(study: Study | None) -> int:
    """The exit code for a study of which a run failed, or 0."""
    return FAILED if study is not None and (study.rows["status"] == "failed").any() else 0


def _not_whole(store: Store, seeds: Mapping[str, Sequence[int]]) -> list[str]:
    """Return the cells of which a run is neither done nor failed."""
    known = store.known(seeds, failed=True)
    return [key for key, own in seeds.items() if not known.get(key, set()).issuperset(own)]


def lost(store: Store, seeds: Mapping[str, Sequence[int]]) -> int:
    """The exit code for cells that have run and are not there, or 0."""
    gone = len(_not_whole(store, seeds))
    if gone:
        print(
            f"jerkbench: {gone} of {len(seeds)} cells are not in {store.folder}, although they have run: somebody has"
            " deleted or damaged their files. The same command runs them again.",
            file=sys.stderr,
        )
    return FAILED if gone else 0


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
    from jerkbench.results.study_report import present

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


# The answer of a dry run: what would run, and for how long.


def tell(plan: Plan, store: Store, config: DictConfig) -> None:
    """Say what would run."""
    for line in forecast(plan, store, config.workers or processors()):
        print(line)
    if config.max_seeds:
        print(f"That is the first look; seeds are added up to {config.max_seeds} where a comparison is undecided.")


def launch(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> list[JobReturn]:
    """Run all jobs of a sweep, and end with the table, also after a failure or Ctrl-C.

    Raises:
        SystemExit: a run failed, or the sweep was interrupted.
    """
    plan, cluster = _planned(loader, config, jobs)
    store, end = Store(study_folder(config)), End()
    if config.dry:
        tell(plan, store, config)
    else:
        with end, Workers(cluster, config.workers or processors()) as workers:
            for end.look in looks_left(planned_looks(plan, config.seeds, config.max_seeds), store):
                run_missing(end.look.plan, store, workers)
                draws = end.look.plan.draws
                if end.look.last or not undecided(load_study(store.folder.parent, draws), end.look.level):
                    break
        if code := _concluded(end, store, config):
            raise SystemExit(code)
    return [JobReturn(status=JobStatus.COMPLETED) for _ in jobs]


class End:
    """The end of a sweep, also of one that cannot go on: what is done is stored, and can be concluded.

    Attributes:
        look: the last that was begun.
        code: exit code of a sweep that did not come to its end, or 0.
    """

    look: Look
    code = 0

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> bool:
        """Say why it ended; an input at fault ends the command."""
        if isinstance(error, KeyboardInterrupt):
            self.code = INTERRUPTED
            sentence = "Interrupted. What is done is stored; the same command goes on from there."
        elif isinstance(error, ClusterError | ChildProcessError):
            self.code, sentence = FAILED, f"jerkbench: the sweep ends here: {error}"
        elif isinstance(error, OSError):
            self.code = FAILED
            sentence = f"jerkbench: the sweep ends here, because a result cannot be stored: {error}."
        elif isinstance(error, JerkbenchError):
            exit_with(error)
        if self.code:
            print(sentence, file=sys.stderr)
        return bool(self.code)


def _planned(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> tuple[Plan, Cluster]:
    """The cells of a sweep, and where they run; says what is left out, and what is to be known of the rest."""
    try:
        with Pulse(lambda seconds: f"Planning {len(jobs)} combinations for {duration(seconds)}."):
            composed = compose_jobs(loader, config, jobs)
            plan = planned(configured_job(job.plain, job.choices, job.overrides) for job in composed)
        cluster = cluster_of(config)
    except JerkbenchError as error:
        exit_with(error)
    for line in (
        *plan.refused,
        *first_complaints(plan.jobs),
        *first_remarks(plan.jobs, shared_inputs()),
    ):
        print(line, file=sys.stderr)
    if not plan.jobs:
        exit_with(PluginError("There is nothing to run: every combination was left out."))
    return plan, cluster


def _concluded(end: End, store: Store, config: DictConfig) -> int:
    """Write and print what came of a sweep; returns its exit code."""
    code, plan = end.code, end.look.plan
    try:
        study = conclude_study(store, plan.draws, config, end.look.level if config.max_seeds else None)
    except OSError as error:
        print(f"jerkbench: the tables cannot be written: {error}. What is done is stored.", file=sys.stderr)
        return FAILED
    if study is not None and not code:
        asked = any(isinstance(job.method.filter, Command) for job in plan.jobs)
        code = draw_and_report(study, config, run_programs=asked)
    return code or failed_code(study) or lost(store, plan.draws)


# The planned order of a sweep whose jobs another launcher than ours runs, each in a process of its
# own.

ORDER_FOLDER = ".order"
"""In the study's folder: a file for each job, named by its number."""


def forget_order(folder: Path) -> None:
    """Delete what an earlier sweep has left."""
    for path in _files(folder):
        path.unlink(missing_ok=True)


def note_place(folder: Path, number: int, job: Job) -> None:
    """Note what the job ``number`` is: a cell, and its seeds."""
    write_text(folder / ORDER_FOLDER / f"{number:07d}", json.dumps([job.key, list(job.draws)]))


def take_order(folder: Path) -> dict[str, list[int]]:
    """Return the cells of all jobs in order, each with its seeds, and delete the notes."""
    found: dict[str, set[int]] = {}
    for path in _files(folder):
        key, draws = json.loads(path.read_text(encoding="utf-8"))
        found.setdefault(key, set()).update(draws)
    forget_order(folder)
    if (folder / ORDER_FOLDER).is_dir():
        (folder / ORDER_FOLDER).rmdir()
    return {key: sorted(draws) for key, draws in found.items()}


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / ORDER_FOLDER).glob("*") if path.name.isdecimal())
