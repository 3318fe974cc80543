"""The workload of engines.py in other libraries, as one run and as a batch, each used as its documentation recommends.

Run r of a batch uses the inputs and measurements from number r on, followed by the first r inputs and measurements.
Therefore all runs and their covariances are different, and no large arrays are stored. The conversion of the arrays to
the format of a library and the compilation are not timed.
"""

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from lines import Absent, Line, apart, timed
from peer_adapters import simdkalman_runs, torch_kf_runs
from peer_dynamax import lgssm_filter_runs, scan_runs
from plain_loops import filterpy_loop

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.contracts import Filter
from jerkbench.timeline import Timeline


class Peer(NamedTuple):
    """A function of a library.

    Attributes:
        name: name in the table.
        package: name of the library on PyPI.
        module: name of the module.
        runs: (timeline, model, runs) -> function that returns the positions (runs, n, 3) [m] of a batch.
        many: number of runs in a batch. Larger batches were not faster, or took too long.
    """

    name: str
    package: str
    module: str
    runs: Callable[[Timeline, Filter, int], Callable[[], FloatArray]]
    many: int


PEERS = (
    Peer("simdkalman", "simdkalman", "simdkalman", simdkalman_runs, 1000),
    Peer("torch-kf", "torch-kf", "torch_kf", torch_kf_runs, 1000),
    Peer("dynamax, lgssm_filter", "dynamax", "dynamax", lgssm_filter_runs, 100),
    Peer("dynamax, its steps", "dynamax", "dynamax", scan_runs, 100),
)


def peer_lines(timeline: Timeline, x: FloatArray, base: float, repeats: int) -> list[Line | Absent]:
    """Return two lines for each installed library: one run, and a batch."""
    model = plugins.create("filter", {"name": "jerk"})
    lines: list[Line | Absent] = []
    for peer in PEERS:
        if find_spec(peer.module) is None:
            lines.append(Absent(peer.name, peer.package))
            continue
        seconds, position_m = timed(peer.runs(timeline, model, 1), repeats)
        lines.append(Line(peer.name, seconds, base / seconds, apart(position_m[0], x[:, :3])))
        seconds, position_m = timed(peer.runs(timeline, model, peer.many), repeats)
        difference = farthest(position_m, timeline, model)
        each = seconds / peer.many
        lines.append(Line(f"{peer.name}, batch of {peer.many}", each, base / each, difference))
    return lines


def farthest(position_m: FloatArray, timeline: Timeline, model: Filter) -> float:
    """Return the largest difference between the plain loop and the first and last run of a batch."""
    last = len(position_m) - 1
    return max(apart(position_m[r], filterpy_loop(later(timeline, r), model)[0][:, :3]) for r in {0, last})


def later(timeline: Timeline, shift: int) -> Timeline:
    """Return the timeline of run number ``shift``, which starts with input and measurement number ``shift``."""
    given = timeline.measurements
    z, R = np.roll(given.z, -shift, axis=0), np.roll(given.R, -shift, axis=0)
    accel = np.roll(timeline.accel_enu_mps2, -shift, axis=0)
    return replace(timeline, accel_enu_mps2=accel, measurements=replace(given, z=z, R=R))
