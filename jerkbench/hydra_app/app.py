"""The Hydra app behind `jerkbench run`: one job, or a sweep of many."""

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from jerkbench.contracts import Estimator, Preparing
from jerkbench.errors import JerkbenchError, PluginError, exit_with
from jerkbench.hydra_app.configuration import (
    LAUNCHER,
    check_options,
    configured_job,
    register_hydra_parts,
    register_schemas,
    study_folder,
)
from jerkbench.hydra_app.launched_sweep import (
    conclude_study,
    draw_and_report,
    failed_code,
    forget_order,
    note_place,
    take_order,
    tell,
)
from jerkbench.hydra_app.looks import typed as typed_seeds
from jerkbench.hydra_app.sweep_words import swept_addresses, without_addresses
from jerkbench.hydra_app.typed_words import arranged_words, refuse_mappings
from jerkbench.hydra_app.words import Words, cluster_of
from jerkbench.jobs.cluster import LOCAL
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.names import refusal, require_sensible
from jerkbench.jobs.plan import Plan, planned
from jerkbench.jobs.preflight import first_remarks
from jerkbench.jobs.progress import Progress, Pulse, duration
from jerkbench.jobs.run import run_missing
from jerkbench.presets import config_folder, folder_words
from jerkbench.report import Choice, figures_choice
from jerkbench.results.manifest import stretches
from jerkbench.results.run_figures import draw_single
from jerkbench.results.store import Store
from jerkbench.results.study import concluded


def prepared_app(arguments: Sequence[str]) -> Callable[[], Any]:
    """Return the app for Hydra's command line ``arguments``; it runs when it is called."""
    if {"-m", "--multirun"} & set(arguments) and {"-c", "--cfg"} & set(arguments):
        exit_with(
            PluginError("--cfg shows the configuration of one run: leave out -m, and give each option one value.")
        )
    refuse_mappings(arguments)
    register_schemas()
    register_hydra_parts()
    app: Callable[[], Any] = hydra.main(version_base="1.3", config_path=str(config_folder()), config_name="config")(one)
    arguments = ["dry=true" if word == "--dry" else word for word in arguments]
    words = [typed for word in arguments for typed in typed_seeds(word)]
    words = swept_addresses(words) if {"-m", "--multirun"} & set(arguments) else without_addresses(words)
    sys.argv = ["jerkbench run", *arranged_words([*folder_words(), *words])]
    return app


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
            study = conclude_study(store, take_order(store.folder.parent), config)
            if code := (draw_and_report(study, config) if study else 0) or failed_code(study):
                raise SystemExit(code)


# One job: a single run, one combination of a sweep that another launcher has started, or a trajectory from elsewhere.


def one(config: DictConfig) -> None:
    """Run one job; what is wrong with an option, or with the combination, is a sentence."""
    task = HydraConfig.get()
    with _sentences():
        check_options(config)
        cluster_of(config)  # not needed here; an option that it has not is refused all the same
        plain: Any = OmegaConf.to_container(config, resolve=True)
        job = configured_job(plain, task.runtime.choices, list(task.overrides.task))
        sweeping, store = task.mode == RunMode.MULTIRUN, Store(study_folder(config))
        if (reason := refusal(job)) and sweeping:
            print(f"Left out: {reason}.", file=sys.stderr)
            return
        require_sensible(job)
        plan = planned([job])
        for line in first_remarks(plan.jobs, shared_inputs()):
            print(line, file=sys.stderr)
        if config.dry:
            tell(plan, store, config)
            return
        if sweeping:
            note_place(store.folder.parent, int(task.job.num), plan.jobs[0])
            run_missing(plan, store, progress=Progress(0))
            return
        drawing = figures_choice(config.figures) is not Choice.NONE
        engine, model = job.method.engine, job.method.filter
        if drawing and isinstance(engine, Preparing) and not isinstance(model, Estimator):
            engine.prepare(model)  # what a trajectory needs and sums do not: to compile it takes as long as all else
        with Pulse(lambda seconds: f"Running for {duration(seconds)}."):
            run_missing(plan, store, strict=True, progress=Progress(0), threads=os.cpu_count() or 1)
        _show(plan, store, config)
        for path in draw_single(plan.jobs[0], study_folder(config), pdf=config.figures_pdf) if drawing else ():
            print(f"Figure: {path}")


def score_files(words: Words, pattern: str, label: str, dataset: Mapping[str, Any] | None = None) -> None:
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
    plan = planned([job])
    store = Store(study_folder(words.config))
    run_missing(plan, store, strict=True, progress=Progress(0), threads=os.cpu_count() or 1)
    _show(plan, store, words.config)
    print(f"\nRows, tables and manifest: {study_folder(words.config)}")


@contextmanager
def _sentences() -> Iterator[None]:
    """End the command with the sentence of an error here, because Hydra would print more than that."""
    try:
        yield
    except JerkbenchError as error:
        exit_with(error)


def _show(plan: Plan, store: Store, config: DictConfig) -> None:
    """Print rows and notes at once, for files and figures take longer than the run; then write the study."""
    from jerkbench.report.tables.terminal import print_run

    folder = study_folder(config)
    (stored,), _ = store.read(plan.draws, {key: stretches(own) for key, own in plan.draws.items()})
    print_run(stored.rows)
    for note in stored.metadata["notes"]:
        print(note, flush=True)
    concluded(folder, plan.draws, list(config.notes), sys.argv, tags=list(config.tags))
