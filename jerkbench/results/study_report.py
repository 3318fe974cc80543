"""The report of a study as one HTML file, with its figures."""

from pathlib import Path

from jerkbench.files import write_text
from jerkbench.report import Choice
from jerkbench.report.analysis.runs import RULE, VerdictRule
from jerkbench.results.manifest import read_manifest
from jerkbench.results.store import Store
from jerkbench.results.study import Study
from jerkbench.results.study_figures import Request, draw_study

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
    figures, report = study.folder / FIGURES, study.folder / REPORT
    if choice is not Choice.NONE:
        print(f"Drawing the figures ({OTHERWISE[choice]}).", flush=True)
    write_report(study, report, Request(choice, out=figures, pdf=pdf, run_programs=run_programs), workers)
    if choice is not Choice.NONE:
        print(f"Figures: {figures}")
    print(f"Report: {report}")


def write_report(
    study: Study,
    path: Path,
    request: Request,
    workers: int,
    method: tuple[str, ...] | None = None,
    rule: VerdictRule = RULE,
) -> None:
    """Draw the figures of a study and write its report as one HTML file.

    Args:
        study: the study.
        path: of the file.
        request: which figures.
        workers: number of processes that draw.
        method: factors that a method is made of; None: those by default.
        rule: by which methods are judged.
    """
    from jerkbench.report.page.page import Results, page

    drawn = draw_study(study, request, workers)

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
