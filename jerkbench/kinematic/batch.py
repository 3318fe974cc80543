"""Many runs from Python: packs of WIDE runs that share their steps, one pack a thread."""

from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import WIDE, aligned_zeros
from jerkbench.compilation.views import RunView
from jerkbench.contracts import Filter
from jerkbench.estimate import Updates
from jerkbench.kinematic.arguments import MARKED, SEEN, Kept, empty_runs
from jerkbench.kinematic.layout import TOTALS, run_type
from jerkbench.kinematic.loop import loop_for
from jerkbench.kinematic.models import model_of
from jerkbench.kinematic.packs import Kind, Pack, pack_runs
from jerkbench.kinematic.plugin_call import Rule, rules_of
from jerkbench.kinematic.single_run import updates_seen
from jerkbench.sums import Run, Streamed

Prepare = Callable[[Pack, Sequence[int]], tuple[Any, ...] | None]
"""A pack, and which places of the batch its WIDE runs have -> the loop, the type of its runs, its third argument, and
those behind the sixth; None where it is not to be run so."""

NOTHING = Updates.empty()


def run_batch(
    runs: Sequence[Run], models: Sequence[Filter], rules: Sequence[Rule], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run all ``runs``, each with its own filter and compiled adaptation.

    Returns one result for each: None where the run is to be repeated alone, because it diverged, came near to it, or
    its adaptation raised an error.
    """

    def prepare(pack: Pack, lanes: Sequence[int]) -> tuple[Any, ...]:
        model = model_of([models[k] for k in lanes], pack.lengths_s, pack.timelines[0].dt0_s)
        n = 2 + len(model.extra)
        return loop_for(n, WIDE, dense=rules[lanes[0]].dense), run_type(n, WIDE), model

    sizes = [2 + len(model.initial_variances()) for model in models]
    return run_packs(runs, sizes, rules, prepare, updates=updates, threads=threads)


def run_packs(
    runs: Sequence[Run],
    sizes: Sequence[Hashable],
    rules: Sequence[Rule],
    prepare: Prepare,
    *,
    updates: bool,
    threads: int,
) -> list[Streamed | None]:
    """Pack runs that have the same ``sizes`` (of the state) and steps, and run one pack a thread.

    Returns one result for each run, as `run_batch` does.
    """
    results: list[Streamed | None] = [None] * len(runs)

    def run_pack(pack: Pack) -> None:
        """Run one pack, filled with its last run, and put the results in their places."""
        lanes = [*pack.members, *[pack.members[-1]] * (WIDE - len(pack.members))]
        prepared = prepare(pack, lanes)
        if prepared is not None:
            loop, of, own, *more = prepared
            kept, rule = _room_of(pack, of, updates=updates), rules_of([rules[k] for k in lanes], of.sizes["s"])
            loop(pack.steps, pack.score, own, rule, kept, empty_runs(of.sizes["n"], WIDE), *more)
            for place, result in zip(pack.members, _results_of(pack, kept, of, updates=updates), strict=True):
                results[place] = result

    kinds = [Kind(size, rule.wants_truth, rule.dense) for size, rule in zip(sizes, rules, strict=True)]
    packs = _packs(tuple(runs), tuple(kinds))
    if threads <= 1 or len(packs) <= 1:
        for pack in packs:
            run_pack(pack)
    else:
        list(_pool(threads).map(run_pack, packs))
    return results


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """To start threads takes as long as a run."""
    return ThreadPoolExecutor(threads, "jerkbench-runs")


_packs = lru_cache(maxsize=2)(pack_runs)  # for the next filter; some 10 MB for each vector of 150 s at 100 Hz


def _room_of(pack: Pack, of: RunView, *, updates: bool) -> Kept:
    """Room for the sums of a pack, and for what its updates saw."""
    m, marks = len(pack.steps.z), int(pack.score.mark.max(initial=-1)) + 1
    return Kept(
        aligned_zeros(of.sizes["length"]),
        np.empty(len(pack.score.truth), dtype=np.int64),
        np.empty((0, 6, WIDE)),
        np.empty((0, 36, WIDE)),
        np.zeros((marks, MARKED, WIDE)),
        np.empty(m, dtype=np.int64),
        np.empty((max(m, 1) if updates else 1, SEEN, WIDE)),
    )


def _results_of(pack: Pack, kept: Kept, of: RunView, *, updates: bool) -> list[Streamed | None]:
    """The sums of each member of a pack; None where they are not finite, or the run is lost."""
    w = kept.w.reshape(-1, WIDE)
    totals = {name: w[np.array(of.fields[name].places) // WIDE] for name in TOTALS}
    finite = np.isfinite(np.concatenate(list(totals.values()))).all(axis=0)
    healthy = finite & (w[of.fields["lost"].places[0] // WIDE] == 0.0)
    return [
        _result(pack, kept, {name: total[:, lane] for name, total in totals.items()}, lane, updates=updates)
        if healthy[lane]
        else None
        for lane in range(len(pack.members))
    ]


def _result(pack: Pack, kept: Kept, total: dict[str, FloatArray], lane: int, *, updates: bool) -> Streamed:
    return Streamed(
        position_m2=total["position"],
        velocity_m2ps2=total["velocity"],
        whole_m2=float(total["whole"][0]),
        outage_m2=float(total["outage"][0]),
        largest_m2=float(total["largest"][0]),
        farthest_m2=float(total["farthest"][0]),
        nees=float(total["nees"][0]),
        nees_position=float(total["nees_position"][0]),
        nis_per_row=float(total["nis"][0]),
        nis_updates=float(total["updates"][0]),
        nis_used_per_row=float(total["nis_used"][0]),
        nis_used_updates=float(total["updates_used"][0]),
        marked_m=kept.errors[pack.marks[lane], :3, lane],
        marked_m2=kept.errors[pack.marks[lane], 3:, lane],
        updates=_updates(pack, kept.seen, lane) if updates else NOTHING,
    )


def _updates(pack: Pack, seen: FloatArray, lane: int) -> Updates:
    """What the updates of one run saw; it may lack some that others have."""
    seen = seen[: len(pack.steps.z)]  # of no update there is a row all the same
    mine = seen[:, 0, lane] > 0
    own = seen[mine, :, lane]
    return updates_seen(pack.update_s[mine], own)
