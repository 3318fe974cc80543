"""The adaptation of several runs: it sees one run after the other, as its author wrote it."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.vectors import WIDTH
from jerkbench.engines.compiled.arguments import Packed, Rule
from jerkbench.engines.compiled.ask import ask_adapt, ask_fade
from jerkbench.engines.compiled.lanes.places import SIZE
from jerkbench.engines.compiled.lanes.runs import Runs, gather, gather_kept, spread
from jerkbench.engines.compiled.places import B


def adapt_runs(
    w: FloatArray, flat: FloatArray, runs: Runs, packed: Packed, rule: Rule, memory: FloatArray, complete: bool
) -> None:
    """Put the adapted R of all runs in the place of what the adaptation gets, without rows of no finite variance.

    Args:
        w: the runs, vector by vector.
        flat: the same, number by number.
        runs: room for what the runs show to the adaptation, and for what it says.
        packed: room for an update that has not all rows.
        rule: the adaptation.
        memory: (WIDTH, size) what it remembers of each run.
        complete: whether all rows of all runs are there.
    """
    spread(w, runs)
    for r in range(6):
        packed.rows[r] = r
    whole = complete
    for lane in range(WIDTH):
        m = 6 if complete else _find_rows(runs.kept[lane], packed.rows)
        own = Rule(rule.parameters, memory[lane], rule.adapt, rule.fade)
        whole = _adapt_run(flat, runs, lane, packed, own, m) and whole
    gather(w, runs)
    if not whole:
        gather_kept(w, runs)


def _adapt_run(flat: FloatArray, runs: Runs, lane: int, packed: Packed, rule: Rule, m: int) -> bool:
    """Adapt R of ``m`` rows of a run; return whether all six are used."""
    if m == 6:
        six = Packed(packed.rows, runs.y[lane], runs.HPHt[lane], runs.given[lane], runs.adapted[lane])
        _ask(flat, lane, six, m, rule)
    else:
        _pack_some(runs, lane, packed, m)
        if m > 0:
            _ask(flat, lane, packed, m, rule)
    whole = m == 6 and _finite(runs.adapted[lane], runs.variance[lane])
    if not whole:
        _unpack(runs, lane, packed, m)
    return whole


def _find_rows(kept: FloatArray, rows: IntArray) -> int:
    """Fill the numbers of the rows that are there; return how many they are."""
    m = 0
    for r in range(6):
        if kept[r] > 0.0:
            rows[m] = r
            m += 1
    return m


def _ask(flat: FloatArray, lane: int, packed: Packed, m: int, rule: Rule) -> None:
    if rule.fade != 0:
        _fade(flat, lane, ask_fade(rule, packed, packed.R, m))
    ask_adapt(rule, packed, packed.R, m, packed.adapted)


def _fade(flat: FloatArray, lane: int, factor: float) -> None:
    """Scale the prior covariance."""
    for e in range(6 * SIZE):
        flat[(B + e) * WIDTH + lane] *= factor


def _finite(adapted: FloatArray, variance: FloatArray) -> bool:
    """Note the variances of six rows; return whether all are finite."""
    total = 0.0
    for r in range(6):
        variance[r] = adapted[7 * r]
        total += variance[r] * 0.0
    return total == 0.0


def _pack_some(runs: Runs, lane: int, packed: Packed, m: int) -> None:
    for i in range(m):
        r = packed.rows[i]
        packed.y[i] = runs.y[lane, r]
        for j in range(m):
            c = packed.rows[j]
            packed.HPHt[m * i + j] = runs.HPHt[lane, 6 * r + c]
            packed.R[m * i + j] = runs.given[lane, 6 * r + c]


def _unpack(runs: Runs, lane: int, packed: Packed, m: int) -> None:
    """Note the variances; write the adapted R without the rows that have no finite one, and drop these."""
    adapted = runs.adapted[lane]
    if m == 6:
        for e in range(36):
            packed.adapted[e] = adapted[e]
    for e in range(36):
        adapted[e] = 0.0
    for i in range(m):
        r = packed.rows[i]
        runs.variance[lane, r] = packed.adapted[(m + 1) * i]
        if np.isfinite(runs.variance[lane, r]):
            for j in range(m):
                if np.isfinite(packed.adapted[(m + 1) * j]):
                    adapted[6 * r + packed.rows[j]] = packed.adapted[m * i + j]
        else:
            runs.kept[lane, r] = 0.0
