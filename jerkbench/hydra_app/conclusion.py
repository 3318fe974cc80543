"""The end of a sweep: manifest, tables, figures, report, and the exit code that they come to."""

import sys
from collections.abc import Mapping, Sequence

from omegaconf import DictConfig

from jerkbench.errors import INTERRUPTED
from jerkbench.execution.processors import processors
from jerkbench.hydra_app.interruption import terminated_like_interrupted
from jerkbench.report.choice import figures_choice
from jerkbench.results.manifest import write_manifest
from jerkbench.results.store import Store
from jerkbench.results.study import Study, load_study, write_study

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
