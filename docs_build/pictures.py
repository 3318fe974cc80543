"""The figures that pages of docs/ show: `python docs_build/pictures.py` draws them anew into docs/img."""

import subprocess
import sys
import tempfile
from pathlib import Path

IMAGES = Path(__file__).parents[1] / "docs" / "img"

STUDY = "results/first"
"""The study of docs/first_table.md."""

SWEEP = (
    "run -m filter=gnss_only,baseline,jerk adaptation=none,mtf disturbance=none,multipath_single_axis,gnss_outage"
    " seeds=10 study=first"
)

DRAWN = {
    "bars.png": "multipath_bars.png",
    "field_multipath_single_axis_field-errors.png": "multipath_errors.png",
}
"""Figures of the study by their names in docs/img."""


def main() -> None:
    """Run the sweep of the first table, and keep some of its figures."""
    with tempfile.TemporaryDirectory() as folder:
        for words in (SWEEP, f"figures {STUDY} --scenarios multipath_single_axis"):
            command = [sys.executable, "-m", "jerkbench", *words.split()]
            subprocess.run(command, cwd=folder, check=True)  # noqa: S603 - our own words
        for drawn, kept in DRAWN.items():
            (IMAGES / kept).write_bytes((Path(folder) / STUDY / "figures" / drawn).read_bytes())


if __name__ == "__main__":
    main()
