"""The end of a study beside its tables: figures, and the report."""

from pathlib import Path

from jerkbench.files import write_text
from jerkbench.report.analysis.rule import RULE, Rule
from jerkbench.results.manifest import read_manifest
from jerkbench.results.store import Store
from jerkbench.results.study import Study
from jerkbench.results.study_figures.choice import Choice
from jerkbench.results.study_figures.files import Drawn, Request, draw_study

FIGURES, REPORT = "figures", "report.html"
PROVENANCE = ("command", "finished", "commit", "versions", "host")
"""Entries of the manifest that the report shows."""

OTHERWISE = {
    Choice.FEW: "figures=all draws those of every scenario, figures=none leaves them out",
    Choice.ALL: "figures=few draws those that carry a finding, figures=none leaves them out",
}
"""What one can ask for instead."""


def present(study: Study, workers: int, choice: Choice, *, pdf: bool = False, run_programs: bool = False) -> None:
    """Draw the figures of a study and write its report; say so before, because it takes a while.

    Args:
        study: the study.
        workers: number of processes.
        choice: which figures.
        pdf: whether each is a PDF, too.
        run_programs: whether programs of stored cells may run; without it they are left out.
    """
    drawn = Drawn()
    if choice is not Choice.NONE:
        print(f"Drawing the figures ({OTHERWISE[choice]}).", flush=True)
        drawn = draw_study(
            study, Request(choice, out=study.folder / FIGURES, pdf=pdf, run_programs=run_programs), workers
        )
        print(f"Figures: {study.folder / FIGURES}")
    write_report(study, drawn, study.folder / REPORT)
    print(f"Report: {study.folder / REPORT}")


def write_report(
    study: Study, drawn: Drawn, path: Path, method: tuple[str, ...] | None = None, rule: Rule = RULE
) -> None:
    """Write the report of a study as one HTML file, its methods made of ``method`` and judged by ``rule``."""
    from jerkbench.report.page.page import Results, page

    stored, _ = Store(study.folder).read(list(dict.fromkeys(study.keys)))
    manifest, labels = read_manifest(study.folder), study.labels
    results = Results(
        name=study.folder.resolve().name,
        rows=study.rows,
        keys=list(study.keys),
        about={cell.key: {**cell.metadata, "labels": labels[cell.key]} for cell in stored},
        notes=study.notes,
        provenance={key: manifest[key] for key in PROVENANCE if key in manifest},
        rule=rule,
        method=method,
    )
    write_text(path, page(results, drawn.pictures, drawn.stretches))
