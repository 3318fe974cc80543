"""The titles above the figures of a run, and the names of their files."""

import hashlib
import re
import textwrap
from collections.abc import Sequence
from dataclasses import replace

from jerkbench.jobs.job import Job
from jerkbench.recording import Recording

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


def bare(label: str) -> str:
    """A label without its parameters: "bias(accel_mps2=0.1)+dropout" is bias+dropout."""
    depth, kept = 0, []
    for letter in label:
        depth += letter == "("
        if not depth:
            kept.append(letter)
        depth -= letter == ")" and depth > 0
    return "".join(kept)
