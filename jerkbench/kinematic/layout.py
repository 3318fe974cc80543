"""The parts of a run, and where in its array they lie.

Every element holds one number of each run. The covariance P[s, t], s = 3 a + i of quantity a and axis i, lies by pairs
of axes (i, j), i <= j, because F = A (x) I3 is the same product for each pair; of equal axes half is used. Of one run
the six pairs stand side by side, because one vector then holds the same element of all of them; of several runs each
pair has a matrix of its own.
"""

from collections.abc import Mapping
from functools import cache

import numpy as np

from jerkbench.compilation.vectors import WIDE
from jerkbench.compilation.views import RunView, View, fields_of

PAIRS = 6
"""Pairs of axes: (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)."""

WEIGHTS = ("counted", "whole", "moving", "both")
"""What a row of the reference counts for; the weights of a row stand in this order."""

SHAPES: dict[str, tuple[int, ...]] = {
    "L": (6, 6),  # of S = H P H' + R = L D L', below its diagonal
    "S_diagonal": (6,),
    "R": (6, 6),  # as the adaptation says, by row of z
    "white": (6,),  # L^-1 y
    "v": (6,),  # S^-1 y
    "y": (6,),  # innovation by row of z, 0 where a row is not used
    "used": (6,),  # 1 where a row is used, else 0
    "variance": (6,),  # diagonal of R, also of a row that it leaves out; NaN where there is none
    "fine": (6,),  # 1 where a row is used and its R is less than H P H', else 0
    "doubt": (),  # above 0 where what an update leaves of a variance may be rounding
    "lost": (),  # above 0 once a matrix was not positive definite
    "ended": (),  # step at whose end that was, or -1
    "e": (6,),  # error of position and velocity
    "square": (),  # of the position error
}

TOTALS: dict[str, tuple[int, ...]] = {
    "position": (3,),
    "velocity": (3,),
    **dict.fromkeys(("whole", "outage", "largest", "farthest", "nees", "nees_position"), ()),
    **dict.fromkeys(("nis", "updates", "nis_used", "updates_used"), ()),
}
"""What is summed up over a run; largest and farthest are maxima of squares."""


@cache
def run_type(n: int, width: int, **sizes: int) -> RunView:
    """Return the type of ``width`` runs of a filter with ``n`` quantities on each axis; ``sizes`` are further ones."""
    return type_with({}, 3 * n, width, **sizes)


def type_with(more: Mapping[str, tuple[int, ...]], s: int, width: int, **sizes: int) -> RunView:
    """Return the type of runs of ``s`` states with ``more`` fields of these shapes."""
    shapes = {**SHAPES, **TOTALS, "x": (s,), "G": (6, s), "Z": (6, s), **more}  # G, Z = S^-1 G: see `correction`
    run = with_covariance(shapes, s, width)
    over_D = View((6,), run.fields["L"].places[::7], width)  # 1/D stands on the diagonal of L
    return RunView({**run.fields, "over_D": over_D}, {**run.sizes, **sizes}, width)


def with_covariance(shapes: Mapping[str, tuple[int, ...]], s: int, width: int) -> RunView:
    """Return the type of runs that have a covariance of ``s`` states, and fields of these ``shapes``.

    Their quantities on each axis are n = s/3, rounded up: what is left over of the last one is never used.
    """
    n, alone = -(-s // 3), width == 1
    stored = {"blocks": (n, n, WIDE) if alone else (PAIRS, n, n), "sames": (WIDE,)}
    views, length = fields_of({**stored, **shapes}, width)
    blocks = list(views.pop("blocks").places)
    pairs = blocks[::WIDE] if alone else blocks[: n * n]
    if alone:
        blocks = np.reshape(blocks, (n, n, WIDE))[:, :, :PAIRS].transpose(2, 0, 1).ravel().tolist()
    P = np.reshape([blocks[e] for e in _covariance(n)], (3 * n, 3 * n))[:s, :s]
    six = np.pad(P[:, :6], ((0, 0), (0, 2)), mode="edge")
    views["block"] = View((PAIRS, n, n), blocks, width)
    views["pairs"] = View((n, n), pairs, WIDE)  # of one run: the same element of all pairs
    views["same"] = View((), views.pop("sames").places[:1], WIDE)  # of one run: 1 for an axis with itself
    views["P"] = View((s, s), P.ravel().tolist(), width)
    views["P_measured"] = View((6, 6), P[:6, :6].ravel().tolist(), width)  # of position and velocity: H P H'
    views["P_six"] = View((s, WIDE), six.ravel().tolist(), width)  # six columns, and two that mean nothing
    return RunView(views, {"n": n, "s": s, "length": length}, width)


def _covariance(n: int) -> list[int]:
    """Which element of (6, n, n) blocks each P[s, t] is."""
    (a, i), (b, j) = np.divmod(np.arange(3 * n)[:, None], 3), np.divmod(np.arange(3 * n), 3)
    swapped = (i > j) | ((i == j) & (a > b))
    a, b, i, j = np.where(swapped, b, a), np.where(swapped, a, b), np.minimum(i, j), np.maximum(i, j)
    places: list[int] = (n * n * (i * (5 - i) // 2 + j) + n * a + b).ravel().tolist()
    return places


RUN = run_type(3, WIDE)
"""The type of the runs at hand: a compilation replaces it."""

DENSE = 1
"""Whether an adaptation of these runs sees whole matrices, likewise: they are shown to nobody else."""
