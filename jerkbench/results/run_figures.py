"""The figures of runs: the titles above them, the names of their files, and those of a single run."""

import hashlib
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.estimate import Estimate
from jerkbench.jobs.job import Job
from jerkbench.jobs.labels import bare
from jerkbench.jobs.rows import run_seed
from jerkbench.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 70
"""Letters of a line: as many as a figure has room for."""
LINES = 3
"""Lines of a title: the figure below it needs its room."""
LONGEST_NAME = 100
"""Letters of a file's name before its hash; a file system takes 255 bytes, endings included."""


def with_title(recording: Recording, job: Job, draw: int) -> Recording:
    """Return the recording with a name that says its disturbance too (if any), and its seed or phase."""
    disturbance = job.labels.disturbance
    disturbed = () if disturbance == "none" else (disturbance,)
    drawn = (f"seed {draw}",) if job.scenario.seeded else (f"phase {draw}",) if len(job.draws) > 1 else ()
    return replace(recording, name=_fitted((recording.name, *disturbed), drawn))


def file_stem(labels: Sequence[str]) -> str:
    """Return a file's name for ``labels``, without its ending: short, and the same for the same labels.

    Parameters are left out of it; a hash of all that the labels say stands for them.
    """
    text = "-".join(labels)
    name = re.sub(r"[^A-Za-z0-9.+=-]+", "_", "-".join(bare(label) for label in labels))
    if len(name) <= LONGEST_NAME and "-".join(map(bare, labels)) == text:
        return name
    return f"{name[:LONGEST_NAME]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def _fitted(named: Sequence[str], drawn: Sequence[str]) -> str:
    """All of it in lines; where these are too many, without the parameters, and then cut."""
    for words in (named, [bare(word) for word in named]):
        lines = textwrap.wrap(", ".join((*words, *drawn)), WIDTH)
        if len(lines) <= LINES:
            return "\n".join(lines)
    tail = ", ".join(("...", *drawn))
    return "\n".join(textwrap.wrap(", ".join(words)[: LINES * WIDTH // 2] + tail, WIDTH))


def draw_single(job: Job, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Draw trajectory and errors of the first seed; returns the files."""
    recording, estimate = run_seed(job, job.draws[0])
    return draw_run(job, with_title(recording, job, job.draws[0]), estimate, folder / "figures", pdf=pdf)


def draw_run(job: Job, recording: Recording, estimate: Estimate, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Draw the trajectory and the errors of one run, with the recording's name above; returns the files."""
    from jerkbench.report.plots.errors_over_time import error_figure, inclination_figure
    from jerkbench.report.plots.style import save_figure
    from jerkbench.report.plots.trajectory import trajectory_figure

    labels = job.labels
    estimates = {f"{labels.filter} + {labels.adaptation}": estimate}
    name = file_stem(labels)
    errors = partial(error_figure, burn_in_s=job.scoring.burn_in_s)
    drawn: dict[str, Callable[..., Figure]] = {"trajectory": trajectory_figure, "errors": errors}
    if estimate.attitude_only:
        drawn = {"inclination": inclination_figure}
    paths = []
    for kind, draw in drawn.items():
        figure = draw(recording, estimates)
        for ending in ("png", "pdf") if pdf else ("png",):
            paths.append(folder / f"{name}-{kind}.{ending}")
            save_figure(figure, paths[-1])
    return paths
