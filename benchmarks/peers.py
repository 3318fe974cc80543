"""The same workload by other libraries, one run and many at once: each as its own documentation would have it.

Run r of many takes the inputs and the measurements from their r-th on (and the first again after the last), so that all
runs differ, and with them their covariances, and nothing large need be kept. What a library asks of the arrays (its own
type, a row of R for every step), and compiling, is done before the time is taken.
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
    """A library, used in one way.

    Attributes:
        name: what stands in the table.
        package: its name on PyPI.
        module: what is imported.
        runs: (timeline, model, how many) -> what runs that many at once and returns their positions (runs, n, 3) [m].
        many: how many at once; more were not faster, or too slow to wait for.
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
    """Two lines a library that is installed: one run, and many at once."""
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
        lines.append(Line(f"{peer.name}, {peer.many} at once", each, base / each, difference))
    return lines


def farthest(position_m: FloatArray, timeline: Timeline, model: Filter) -> float:
    """Return the largest difference of the first and of the last of many runs from the plain loop."""
    last = len(position_m) - 1
    return max(apart(position_m[r], filterpy_loop(later(timeline, r), model)[0][:, :3]) for r in {0, last})


def later(timeline: Timeline, shift: int) -> Timeline:
    """Run number ``shift``: inputs and measurements from that one on."""
    given = timeline.measurements
    z, R = np.roll(given.z, -shift, axis=0), np.roll(given.R, -shift, axis=0)
    accel = np.roll(timeline.accel_enu_mps2, -shift, axis=0)
    return replace(timeline, accel_enu_mps2=accel, measurements=replace(given, z=z, R=R))
