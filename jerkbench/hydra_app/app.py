"""The Hydra app behind `jerkbench run`: one cell, or a sweep of many."""

import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import hydra
from hydra.conf import HydraConf
from hydra.core.config_loader import ConfigLoader
from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import JobReturn, JobStatus
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from jerkbench.cells.cell import refusal
from jerkbench.clusters.cluster import Cluster, ClusterError
from jerkbench.errors import INTERRUPTED, JerkbenchError, PluginError, exit_with
from jerkbench.execution.cell_run import CellRun
from jerkbench.execution.data_mistakes import first_mistakes
from jerkbench.execution.inputs import shared_inputs
from jerkbench.execution.notes import first_remarks
from jerkbench.execution.plugin_probe import first_complaints
from jerkbench.execution.processors import processors
from jerkbench.execution.pulse import Pulse, duration
from jerkbench.hydra_app.addressed_parameters import swept_addresses, without_addresses
from jerkbench.hydra_app.arguments import arranged_words
from jerkbench.hydra_app.chosen_cluster import cluster_of
from jerkbench.hydra_app.composition import compose_jobs
from jerkbench.hydra_app.configuration import cell_of, register_schemas, study_folder
from jerkbench.hydra_app.hydra_parts import LAUNCHER, register_hydra_parts
from jerkbench.hydra_app.launched_order import forget_order, note_place, take_order
from jerkbench.hydra_app.options import check_options
from jerkbench.hydra_app.single_run import draw_single, prepare_drawing, run_single_cell
from jerkbench.presets import config_folder
from jerkbench.results.store import Store
from jerkbench.results.study import Study, load_study, set_aside, write_manifest, write_study
from jerkbench.results.study_figures.choice import Choice, figures_choice
from jerkbench.sweep.auto_seeds import planned_looks, run_looks
from jerkbench.sweep.auto_seeds import typed as typed_seeds
from jerkbench.sweep.forecast import forecast, lines
from jerkbench.sweep.seed_blocks import finish_cell
from jerkbench.sweep.sweep import LOCAL, Plan, plan_sweep, run_sweep
from jerkbench.sweep.tasks import Planned

FAILED = 1
"""Exit code of a sweep of which a run failed."""


def main(arguments: Sequence[str]) -> None:
    """Run the app with Hydra's command line ``arguments``."""
    if {"-m", "--multirun"} & set(arguments) and {"-c", "--cfg"} & set(arguments):
        exit_with(
            PluginError("--cfg shows the configuration of one run: leave out -m, and give each option one value.")
        )
    register_schemas()
    register_hydra_parts()
    app = hydra.main(version_base="1.3", config_path=str(config_folder()), config_name="config")(_task)
    arguments = ["dry=true" if word == "--dry" else word for word in arguments]
    words = [typed for word in arguments for typed in typed_seeds(word)]
    words = swept_addresses(words) if {"-m", "--multirun"} & set(arguments) else without_addresses(words)
    sys.argv = ["jerkbench run", *arranged_words(words)]
    app()


def sweep(loader: ConfigLoader, config: DictConfig, jobs: Sequence[Sequence[str]]) -> list[JobReturn]:
    """Run all jobs of a sweep, and end with the table, also after a failure or Ctrl-C.

    Raises:
        SystemExit: a run failed, or the sweep was interrupted.
    """
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
    store = Store(study_folder(config))
    if config.dry:
        _tell(plan, store, config)
        return [JobReturn(status=JobStatus.COMPLETED) for _ in jobs]
    last, code = run_looks(
        planned_looks(plan, config.seeds, config.max_seeds),
        store,
        lambda plan: _run(plan, store, config.workers or processors(), cluster),
        lambda look: load_study(store.folder.parent, prefer=[planned.key for planned in look.plan.cells]),
    )
    try:
        study = _conclude(
            store, [planned.key for planned in last.plan.cells], config, last.level if config.max_seeds else None
        )
    except OSError as error:
        print(f"jerkbench: the tables cannot be written: {error}. What is done is stored.", file=sys.stderr)
        raise SystemExit(FAILED) from None
    if study is not None and not code:
        code = _present(study, config)
    if code := code or _failed(study) or _lost(store, [planned.key for planned in last.plan.cells]):
        raise SystemExit(code)
    return [JobReturn(status=JobStatus.COMPLETED) for _ in jobs]


def _run(plan: Plan, store: Store, workers: int, cluster: Cluster) -> int:
    """Run the plan; returns the exit code of a sweep that did not come to its end, or 0."""
    try:
        store.prepare()
        finished = store.look([planned.key for planned in plan.cells])
        if finished.damaged:
            store.set_aside(finished.damaged)
            print(set_aside(finished.damaged), file=sys.stderr)
        with _terminated_like_interrupted():
            run_sweep(plan, store, workers, finished.done, cluster)
    except KeyboardInterrupt:
        print("Interrupted. What is done is stored; the same command goes on from there.", file=sys.stderr)
        return INTERRUPTED
    except ClusterError as error:
        print(f"jerkbench: the sweep ends here: {error}", file=sys.stderr)
        return FAILED
    except OSError as error:
        print(f"jerkbench: the sweep ends here, because a result cannot be stored: {error}.", file=sys.stderr)
        return FAILED
    except JerkbenchError as error:
        exit_with(error)
    return 0


def _tell(plan: Plan, store: Store, config: DictConfig) -> None:
    """Say what would run."""
    for line in lines(forecast(plan, store), config.workers or processors()):
        print(line)
    if config.max_seeds:
        print(f"That is the first look; seeds are added up to {config.max_seeds} where a comparison is undecided.")


class Conclude(Callback):
    """Writes the table after a sweep that another launcher than ours has run."""

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:  # noqa: ANN401 - Hydra's signature
        """Forget the order of an earlier sweep that did not come to its end."""
        forget_order(study_folder(config))

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:  # noqa: ANN401 - Hydra's signature
        """Write and print the table of the sweep, in planned order; exits as our own launcher would."""
        if config.hydra.launcher["_target_"] != LAUNCHER:
            store = Store(study_folder(config))
            if config.max_seeds:
                print("Seeds are added by our own launcher only; these are the first.", file=sys.stderr)
            if cluster_of(config) != LOCAL:
                print("cluster= is for our own launcher; this sweep ran where its launcher ran it.", file=sys.stderr)
            study = _conclude(store, take_order(store.folder.parent), config)
            if code := (_present(study, config) if study else 0) or _failed(study):
                raise SystemExit(code)


def _task(config: DictConfig) -> None:
    """One job: a single run, or one cell of a sweep that another launcher has started."""
    try:
        _run_job(config, HydraConfig.get())
    except JerkbenchError as error:  # here, because Hydra would print more than the sentence
        exit_with(error)


def _run_job(config: DictConfig, job: HydraConf) -> None:
    check_options(config)
    plain: Any = OmegaConf.to_container(config, resolve=True)
    cell = cell_of(plain, job.runtime.choices, list(job.overrides.task))
    sweeping = job.mode == RunMode.MULTIRUN
    if reason := refusal(cell):
        if not sweeping:
            raise PluginError(f"This combination makes no sense: {reason}.")
        print(f"Left out: {reason}.", file=sys.stderr)
        return
    (planned,) = plan_sweep([cell]).cells
    mistakes = first_mistakes([planned.cell], shared_inputs())
    for line in (*mistakes, *first_remarks([(planned.cell, planned.fingerprint)], shared_inputs())):
        print(line, file=sys.stderr)
    folder = study_folder(config)
    if config.dry:
        _tell(Plan((planned,), ()), Store(folder), config)
        return
    if not sweeping:
        _run_and_show(planned, folder, config)
        return
    note_place(folder, int(job.job.num), planned.key)
    if not Store(folder).done(planned.key):
        finish_cell(planned, Store(folder), CellRun(planned.cell, planned.fingerprint).pieces)


def _run_and_show(planned: Planned, folder: Path, config: DictConfig) -> None:
    from jerkbench.report.tables.terminal import print_run

    Store(folder).prepare()
    drawing = figures_choice(config.figures) is not Choice.NONE
    if drawing:
        prepare_drawing(planned.cell)
    with Pulse(lambda seconds: f"Running for {duration(seconds)}."):
        stored = run_single_cell(planned, folder)
    print_run(stored.rows)  # at once: files and figures take longer than the run
    for note in stored.metadata["notes"]:
        print(note, flush=True)
    write_manifest(folder, [planned.key], list(config.notes), sys.argv, tags=list(config.tags))
    write_study(load_study(folder, prefer=[planned.key]))
    for path in draw_single(planned, folder, pdf=config.figures_pdf) if drawing else ():
        print(f"Figure: {path}")


def _conclude(store: Store, keys: Sequence[str], config: DictConfig, level: float | None = None) -> Study | None:
    """Write and print the tables of what is there; returns the cells ``keys``, or nothing without any."""
    from jerkbench.report.tables.terminal import print_beginning, print_table

    folder = store.folder.parent
    if not store.look(keys).whole:
        return None
    store.compact()
    write_manifest(folder, keys, list(config.notes), sys.argv, level, list(config.tags))
    study = load_study(folder, prefer=keys)
    table = write_study(study)
    shown = study.only(keys)
    if len(shown.rows) == len(study.rows):
        print_beginning(table)
    else:
        print_table(shown.rows, shown.notes)
    print(f"\nRows, tables and manifest: {folder}", flush=True)
    return shown


def _failed(study: Study | None) -> int:
    """The exit code for a study of which a run failed, or 0."""
    return FAILED if study is not None and (study.rows["status"] == "failed").any() else 0


def _lost(store: Store, keys: Sequence[str]) -> int:
    """The exit code for cells that have run and are not there, or 0."""
    gone = len(keys) - len(store.look(keys).whole)
    if gone:
        print(
            f"jerkbench: {gone} of {len(keys)} cells are not in {store.folder}, although they have run: somebody has"
            " deleted or damaged their files. The same command runs them again.",
            file=sys.stderr,
        )
    return FAILED if gone else 0


def _present(study: Study, config: DictConfig) -> int:
    """Draw the figures and write the report where they are asked for; returns the exit code, or 0."""
    if not config.report:
        return 0
    from jerkbench.results.study_figures.presentation import present

    try:
        with _terminated_like_interrupted():
            present(study, config.workers or processors(), figures_choice(config.figures), pdf=config.figures_pdf)
    except KeyboardInterrupt:
        print(f"Interrupted. The results are complete; `jerkbench report {study.folder}` draws again.", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        print(f"jerkbench: the figures and the report cannot be written: {error}. The results are.", file=sys.stderr)
        return FAILED
    return 0


@contextmanager
def _terminated_like_interrupted() -> Iterator[None]:
    """Let SIGTERM end a sweep as Ctrl-C does."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
