"""The figures of docs/. `python docs_build/pictures.py` draws them into docs/img."""

import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "img"


class Page(NamedTuple):
    """The commands (one per line) of a page, and the figures to copy: file pattern -> name in docs/img."""

    commands: str
    drawn: dict[str, str]


PAGES = {
    "index": Page(
        """\
run -m filter=gnss_only,baseline,jerk adaptation=none,mtf disturbance=multipath_single_axis seeds=10 study=one
figures results/one
""",
        {"results/one/figures/bars.png": "multipath_bars.png"},
    ),
    "first_table": Page(
        """\
run -m filter=gnss_only,baseline,jerk adaptation=none,mtf disturbance=none,multipath_single_axis,gnss_outage \
seeds=10 study=first
figures results/first --scenarios multipath_single_axis
""",
        {
            "results/first/figures/*multipath_single_axis*-errors.png": "multipath_errors.png",
        },
    ),
    "faults": Page(
        """\
run -m dataset=field dataset.duration_s=400 disturbance=spike_sweep filter=jerk adaptation=none,chi2,huber_r \
seeds=4 study=spikes
run -m dataset=field dataset.duration_s=150 disturbance=false_return disturbance.false_return.offset_m=100 \
filter=jerk adaptation=none,chi2,huber_r,relaxing_gate seeds=4 study=returns
figures results/spikes
figures results/returns
""",
        {
            "results/spikes/figures/*-errors.png": "spikes.png",
            "results/returns/figures/*-errors.png": "false_return.png",
            "results/returns/figures/*-three-sigma.png": "silent_error.png",
        },
    ),
    "taroz": Page(
        "data fetch taroz\nsmooth taroz --to gpx --figure smooth.png\n",
        {"smooth.png": "smooth.png"},
    ),
    "pixel4": Page(
        "data fetch pixel4\nsmooth pixel4 --to gpx --figure fetched.png\n",
        {"fetched.png": "fetched.png"},
    ),
}
"""Keys are pages of docs/ or names of recordings."""


def draw(page: Page) -> None:
    """Run the commands in a folder with the log of docs/own_log.md, and copy the figures."""
    sys.path.insert(0, str(ROOT / "tests" / "inspection"))
    from logs import car_log

    with tempfile.TemporaryDirectory() as folder:
        car_log(Path(folder))
        for words in page.commands.splitlines():
            command = [sys.executable, "-m", "jerkbench", *shlex.split(words)]
            subprocess.run(command, cwd=folder, check=True)  # noqa: S603 - fixed commands
        for pattern, name in page.drawn.items():
            (path,) = Path(folder).glob(pattern)
            (IMAGES / name).write_bytes(path.read_bytes())


if __name__ == "__main__":
    for name in sys.argv[1:] or PAGES:
        draw(PAGES[name])
