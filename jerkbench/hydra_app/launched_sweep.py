"""A sweep of our own launcher: planned, run, concluded; and what a sweep of another launcher needs of it."""

import json
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from hydra.core.config_loader import ConfigLoader
from hydra.core.utils import JobReturn, JobStatus
from omegaconf import DictConfig

from jerkbench.errors import INTERRUPTED, JerkbenchError, PluginError, exit_with
from jerkbench.files import write_text
from jerkbench.filters.command import Command
from jerkbench.hydra_app.composition import compose_jobs
from jerkbench.hydra_app.configuration import cell_of, study_folder
from jerkbench.hydra_app.words import cluster_of
from jerkbench.jobs.cluster import Cluster, ClusterError, Workers
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.pool import processors
from jerkbench.jobs.preflight import first_complaints, first_mistakes
from jerkbench.jobs.progress import Pulse, duration
from jerkbench.jobs.rows import first_remarks
from jerkbench.report.choice import figures_choice
from jerkbench.results.manifest import write_manifest
from jerkbench.results.store import Store
from jerkbench.results.study import Study, load_study, write_study
from jerkbench.sweep.looks import forecast, lines, planned_looks, run_looks
from jerkbench.sweep.sweep import Plan, plan_sweep, run_sweep
from jerkbench.sweep.tasks import Planned

# The end of a sweep by SIGTERM.


@contextmanager
def terminated_like_interrupted() -> Iterator[None]:
    """Let SIGTERM end a sweep as Ctrl-C does."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


# The end of a sweep: manifest, tables, figures, report, and the exit code that they come to.

FAILED = 1
"""Exit code of a sweep of which a run failed."""


Seeds = Mapping[str, Sequence[int]]
"""Of cells that were run, by their keys."""


def conclude(store: Store, seeds: Seeds, config: DictConfig, level: float | None = None) -> Study | None:
    """Write and print the tables of what is there; returns the cells that were run, or nothing where none is whole."""
    from jerkbench.report.tables.terminal import print_beginning, print_table

    folder = store.folder.parent
    gone = _not_whole(store, seeds)
    if len(gone) == len(seeds):
        return None
    store.compact()
    there = {key: () if key in gone else own for key, own in seeds.items()}
    write_manifest(folder, there, list(config.notes), sys.argv, level, list(config.tags))
    study = load_study(folder, prefer=list(seeds))
    table = write_study(study)
    shown = study.only(seeds)
    if len(shown.rows) == len(study.rows):
        print_beginning(table)
    else:
        print_table(shown.rows, shown.notes)
    print(f"\nRows, tables and manifest: {folder}", flush=True)
    return shown


def failed(study: Study | None) -> int:
    """The exit code for a study of which a run failed, or 0."""
    return FAILED if study is not None and (study.rows["status"] == "failed").any() else 0


def _not_whole(store: Store, seeds: Seeds) -> list[str]:
    """Return the cells of which a run is neither done nor failed."""
    known = store.known(seeds, failed=True)
    return [key for key, own in seeds.items() if not known.get(key, set()).issuperset(own)]


def lost(store: Store, seeds: Seeds) -> int:
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
    from jerkbench.results.study_figures import present

    try:
        with terminated_like_interrupted():
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
    for line in lines(forecast(plan, store), config.workers or processors()):
        print(line)
    if config.max_seeds:
        print(f"That is the first look; seeds are added up to {config.max_seeds} where a comparison is undecided.")


def launch(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> list[JobReturn]:
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
    with Workers(cluster, config.workers or processors()) as workers:
        last, code = run_looks(
            planned_looks(plan, config.seeds, config.max_seeds),
            store,
            lambda plan: run_plan(plan, store, workers),
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


def run_plan(plan: Plan, store: Store, workers: Workers) -> int:
    """Run the plan; returns the exit code of a sweep that did not come to its end, or 0."""
    try:
        with terminated_like_interrupted():
            run_sweep(plan, store, workers)
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


# The planned order of a sweep whose jobs another launcher than ours runs, each in a process of its
# own.

FOLDER = ".order"
"""In the study's folder: a file for each job, named by its number."""


def forget_order(folder: Path) -> None:
    """Delete what an earlier sweep has left."""
    for path in _files(folder):
        path.unlink(missing_ok=True)


def note_place(folder: Path, number: int, planned: Planned) -> None:
    """Note what the job ``number`` is: a cell, and its seeds."""
    write_text(folder / FOLDER / f"{number:07d}", json.dumps([planned.key, list(planned.draws)]))


def take_order(folder: Path) -> dict[str, list[int]]:
    """Return the cells of all jobs in order, each with its seeds, and delete the notes."""
    found: dict[str, set[int]] = {}
    for path in _files(folder):
        key, draws = json.loads(path.read_text(encoding="utf-8"))
        found.setdefault(key, set()).update(draws)
    forget_order(folder)
    if (folder / FOLDER).is_dir():
        (folder / FOLDER).rmdir()
    return {key: sorted(draws) for key, draws in found.items()}


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / FOLDER).glob("*") if path.name.isdecimal())
