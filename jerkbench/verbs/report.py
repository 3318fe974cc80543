"""`jerkbench report`: a study as one HTML file, which needs no network."""

import argparse
from pathlib import Path

from jerkbench.verbs.kinds import Verbs


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    report = verbs.add_parser("report", help="write a study as one HTML file: findings, every cell, figures, a review")
    report.add_argument("folder", type=Path, help="the study's folder, or a folder of cells")
    report.add_argument("--out", type=Path, help="the file (default: report.html in the study's folder)")
    report.add_argument("--scenarios", type=int, default=6, help="draw the runs of so many scenarios (default: 6)")
    report.set_defaults(answer=answer)


def answer(chosen: argparse.Namespace) -> None:
    """Write the report, and name the file.

    Raises:
        JerkbenchError: there are no results.
    """
    from jerkbench.benchmark.drawing import drawings
    from jerkbench.benchmark.store import Store
    from jerkbench.benchmark.study import load_study, read_manifest
    from jerkbench.files import write_text
    from jerkbench.report.page.page import Results, page

    study = load_study(chosen.folder)
    stored, _ = Store(chosen.folder).read(list(dict.fromkeys(study.keys)))
    manifest = read_manifest(chosen.folder)
    results = Results(
        name=chosen.folder.resolve().name,
        rows=study.rows,
        keys=list(study.keys),
        about={one.key: one.about for one in stored},
        notes=study.notes,
        provenance={
            key: manifest[key] for key in ("command", "finished", "commit", "versions", "host") if key in manifest
        },
    )
    figures = ((one.caption, one.figure) for one in drawings(study, chosen.folder, chosen.scenarios))
    path = chosen.out or chosen.folder / "report.html"
    write_text(path, page(results, figures))
    print(path)
