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
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import JobReturn, JobStatus
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from jerkbench.cells.cell import refusal
from jerkbench.errors import INTERRUPTED, JerkbenchError, PluginError, exit_with
from jerkbench.execution.cell_run import CellRun
from jerkbench.execution.data_mistakes import first_mistakes
from jerkbench.execution.inputs import shared_inputs
from jerkbench.execution.notes import first_remarks
from jerkbench.execution.processors import processors
from jerkbench.execution.pulse import Pulse, duration
from jerkbench.hydra_app.arguments import arranged_words
from jerkbench.hydra_app.composition import compose_jobs
from jerkbench.hydra_app.configuration import cell_of, register_schemas, study_folder
from jerkbench.hydra_app.options import check_options
from jerkbench.hydra_app.single_run import draw_single, prepare_drawing, run_single_cell
from jerkbench.presets import config_folder
from jerkbench.results.store import Store
from jerkbench.results.study import Study, damaged, load_study, write_manifest, write_study
from jerkbench.sweep.auto_seeds import planned_looks, run_looks
from jerkbench.sweep.auto_seeds import typed as typed_seeds
from jerkbench.sweep.seed_blocks import finish_cell
from jerkbench.sweep.sweep import Plan, plan_sweep, run_sweep
from jerkbench.sweep.tasks import Planned

FAILED = 1
"""Exit code of a sweep of which a run failed."""
SWEEPER = "hydra_plugins.jerkbench.JerkbenchSweeper"
LAUNCHER = "hydra_plugins.jerkbench.JerkbenchLauncher"


def main(arguments: Sequence[str]) -> None:
    """Run the app with Hydra's command line ``arguments``."""
    if {"-m", "--multirun"} & set(arguments) and {"-c", "--cfg"} & set(arguments):
        exit_with(
            PluginError("--cfg shows the configuration of one run: leave out -m, and give each option one value.")
        )
    register_schemas()
    _register_hydra_parts()
    app = hydra.main(version_base="1.3", config_path=str(config_folder()), config_name="config")(_task)
    sys.argv = ["jerkbench run", *arranged_words([typed for word in arguments for typed in typed_seeds(word)])]
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
    except JerkbenchError as error:
        exit_with(error)
    for line in (
        *plan.refused,
        *first_mistakes((planned.cell for planned in plan.cells), shared_inputs()),
        *first_remarks(((planned.cell, planned.fingerprint) for planned in plan.cells), shared_inputs()),
    ):
        print(line, file=sys.stderr)
    if not plan.cells:
        exit_with(PluginError("There is nothing to run: every combination was left out."))
    store = Store(study_folder(config))
    last, code = run_looks(
        planned_looks(plan, config.seeds, config.max_seeds),
        store,
        lambda plan: _run(plan, store, config.workers or processors()),
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
    if code := code or _failed(study):
        raise SystemExit(code)
    return [JobReturn(status=JobStatus.COMPLETED) for _ in jobs]


def _run(plan: Plan, store: Store, workers: int) -> int:
    """Run the plan; returns the exit code of a sweep that did not come to its end, or 0."""
    try:
        store.prepare()
        done, broken = store.look([planned.key for planned in plan.cells])
        if broken:
            print(f"{damaged(broken)} run again: {', '.join(broken)}.", file=sys.stderr)
        with _terminated_like_interrupted():
            run_sweep(plan, store, workers, done)
    except KeyboardInterrupt:
        print("Interrupted. What is done is stored; the same command goes on from there.", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        print(f"jerkbench: the sweep ends here, because a result cannot be stored: {error}.", file=sys.stderr)
        return FAILED
    except JerkbenchError as error:
        exit_with(error)
    return 0


class Conclude(Callback):
    """Writes the table after a sweep that another launcher than ours has run."""

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:  # noqa: ANN401 - Hydra's signature
        """Write and print the table of the whole study; exits as our own launcher would."""
        if config.hydra.launcher["_target_"] != LAUNCHER:
            store = Store(study_folder(config))
            if config.max_seeds:
                print("Seeds are added by our own launcher only; these are the first.", file=sys.stderr)
            study = _conclude(store, [stored.key for stored in store.read()[0]], config)
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
    if not sweeping:
        _run_and_show(planned, folder, config)
    elif not Store(folder).done(planned.key):
        finish_cell(planned, Store(folder), CellRun(planned.cell, planned.fingerprint).pieces)


def _run_and_show(planned: Planned, folder: Path, config: DictConfig) -> None:
    from jerkbench.report.tables.terminal import print_run

    Store(folder).prepare()
    if config.figures:
        prepare_drawing(planned.cell)
    with Pulse(lambda seconds: f"Running for {duration(seconds)}."):
        stored = run_single_cell(planned, folder)
    print_run(stored.rows)  # at once: files and figures take longer than the run
    for note in stored.metadata["notes"]:
        print(note, flush=True)
    write_manifest(folder, [planned.key], list(config.notes), sys.argv)
    write_study(load_study(folder, prefer=[planned.key]))
    for path in draw_single(planned, folder) if config.figures else ():
        print(f"Figure: {path}")


def _conclude(store: Store, keys: Sequence[str], config: DictConfig, level: float | None = None) -> Study | None:
    """Write and print the tables of what is there; returns the cells ``keys``, or nothing without any."""
    from jerkbench.report.tables.terminal import print_table

    folder = store.folder.parent
    if not any(store.path(key).exists() for key in keys):
        return None
    write_manifest(folder, keys, list(config.notes), sys.argv, level)
    study = load_study(folder, prefer=keys)
    write_study(study)
    shown = study.only(keys)
    print_table(shown.rows, shown.notes)
    print(f"\nRows, tables and manifest: {folder}", flush=True)
    return shown


def _failed(study: Study | None) -> int:
    """The exit code for a study of which a run failed, or 0."""
    return FAILED if study is not None and (study.rows["status"] == "failed").any() else 0


def _present(study: Study, config: DictConfig) -> int:
    """Draw the figures and write the report where they are asked for; returns the exit code, or 0."""
    from jerkbench.results.study_figures.presentation import present

    if not config.report:
        return 0
    try:
        with _terminated_like_interrupted():
            present(study, config.workers or processors(), figures=config.figures)
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


def _register_hydra_parts() -> None:
    store = ConfigStore.instance()
    store.store(group="hydra/launcher", name="jerkbench", node={"_target_": LAUNCHER})
    sweeper: dict[str, Any] = {"_target_": SWEEPER, "max_batch_size": None, "params": {}}
    store.store(group="hydra/sweeper", name="jerkbench", node=sweeper)
    callback = {"conclude": {"_target_": "jerkbench.hydra_app.app.Conclude"}}
    store.store(group="hydra/callbacks", name="jerkbench", node=callback)
