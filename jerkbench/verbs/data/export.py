"""`jerkbench data export`: recordings as methods get them, disturbed, one folder a seed, the reference beside them."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.verbs.arguments import Verbs, add_verb, output

if TYPE_CHECKING:
    from jerkbench.cells.cell import Cell

EPILOG = """\
KEY=VALUE are those of `jerkbench run`: dataset, disturbance, attitude, their parameters, seeds, first_seed.

  jerkbench data export drive dataset=field disturbance=gnss_outage seeds=5
  jerkbench data export drive dataset=field seeds=1 --format csv kf_gins pyins mcap

FOLDER/SEED/recording.csv has a row for each stamp of any stream; recording.json says what its columns are. What a
method does not get, the reference, is FOLDER/SEED/reference.csv.
"""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    export = add_verb(verbs, "export", "write disturbed recordings for programs of your own, one folder a seed", answer)
    export.formatter_class = argparse.RawDescriptionHelpFormatter
    export.epilog = EPILOG
    export.add_argument("folder", type=output, help="the folder to write; it must not be there yet")
    export.add_argument("words", nargs="*", metavar="KEY=VALUE", help="what `jerkbench run` takes")
    export.add_argument(
        "--format",
        nargs="+",
        default=["csv"],
        metavar="FORMAT",
        help="csv (default), parquet, bag, mcap, kf_gins, pyins; give it after KEY=VALUE",
    )
    export.add_argument("--without-reference", action="store_true", help="leave reference.csv out")


def answer(chosen: argparse.Namespace) -> None:
    """Write a folder for each seed.

    Raises:
        JerkbenchError: the folder is there, a format or a word is unknown, or a format lacks something.
    """
    from jerkbench.errors import JerkbenchError, unknown
    from jerkbench.hydra_app.words import composed
    from jerkbench.io.recording_folder import FORMATS

    folder: Path = chosen.folder
    for name in chosen.format:
        if name not in FORMATS:
            raise JerkbenchError(unknown("format", name, FORMATS))
    if folder.exists():
        raise JerkbenchError(f"{folder} is there already; delete it or give another name.")
    cell = composed(chosen.words).cell()
    for draw in cell.draws:
        for path in _write(cell, draw, folder / str(draw), chosen):
            print(path)


def _write(cell: "Cell", draw: int, folder: Path, chosen: argparse.Namespace) -> list[Path]:
    from jerkbench.cells.data import data_fingerprint
    from jerkbench.execution.inputs import shared_inputs
    from jerkbench.io.method_input import write_reference
    from jerkbench.io.recording_folder import write_recording

    inputs = shared_inputs()
    recording = inputs.recording(cell, data_fingerprint(cell.dataset, cell.disturbances), draw)
    source = {"seed": draw, **{kind: cell.spec[kind] for kind in ("dataset", "disturbance", "attitude")}}
    attitude = inputs.attitude(recording, cell.attitude)
    paths = write_recording(recording, attitude, folder, chosen.format, {"made_of": source})
    if chosen.without_reference:
        return paths
    write_reference(recording, folder / "reference.csv")
    return [*paths, folder / "reference.csv"]
