"""The end of a study beside its tables: figures, and the report."""

from pathlib import Path

from jerkbench.files import write_text
from jerkbench.results.store import Store
from jerkbench.results.study import Study, read_manifest
from jerkbench.results.study_figures.files import LIMIT, Drawn, draw_study

FIGURES, REPORT = "figures", "report.html"
PROVENANCE = ("command", "finished", "commit", "versions", "host")
"""Entries of the manifest that the report shows."""

PAPER = "experiment=paper"
"""The study that asks whether the paper's claim holds; a report of any other says nothing about it."""


def present(study: Study, workers: int, *, figures: bool) -> None:
    """Draw the figures of a study and write its report; say so before, because it takes a while."""
    drawn = Drawn()
    if figures:
        print("Drawing the figures (figures=false leaves them out).", flush=True)
        drawn = draw_study(study, study.folder / FIGURES, LIMIT, workers)
        print(f"Figures: {study.folder / FIGURES}")
    write_report(study, drawn, study.folder / REPORT)
    print(f"Report: {study.folder / REPORT}")


def write_report(study: Study, drawn: Drawn, path: Path) -> None:
    """Write the report of a study as one HTML file."""
    from jerkbench.report.page.page import Results, page

    stored, _ = Store(study.folder).read(list(dict.fromkeys(study.keys)))
    manifest = read_manifest(study.folder)
    results = Results(
        name=study.folder.resolve().name,
        rows=study.rows,
        keys=list(study.keys),
        about={cell.key: cell.metadata for cell in stored},
        notes=study.notes,
        provenance={key: manifest[key] for key in PROVENANCE if key in manifest},
        of_the_paper=PAPER in manifest.get("command", ()),
    )
    write_text(path, page(results, drawn.pictures, drawn.stretches))
