"""The end of a study beside its tables: figures, and the report."""

from collections.abc import Sequence
from pathlib import Path

from jerkbench.files import write_text
from jerkbench.report.plots.picture import Picture
from jerkbench.results.store import Store
from jerkbench.results.study import Study, read_manifest
from jerkbench.results.study_figures.files import LIMIT, draw_pictures

FIGURES, REPORT = "figures", "report.html"
PROVENANCE = ("command", "finished", "commit", "versions", "host")
"""Entries of the manifest that the report shows."""


def present(study: Study, workers: int, *, figures: bool) -> None:
    """Draw the figures of a study and write its report; say so before, because it takes a while."""
    pictures: list[Picture] = []
    if figures:
        print("Drawing the figures (figures=false leaves them out).", flush=True)
        pictures = draw_pictures(study, study.folder / FIGURES, LIMIT, workers)
        print(f"Figures: {study.folder / FIGURES}")
    write_report(study, pictures, study.folder / REPORT)
    print(f"Report: {study.folder / REPORT}")


def write_report(study: Study, pictures: Sequence[Picture], path: Path) -> None:
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
    )
    write_text(path, page(results, pictures))
