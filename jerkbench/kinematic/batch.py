"""Many runs from Python: packs of WIDE runs that share their steps, one pack a thread."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import WIDE, aligned_zeros
from jerkbench.compilation.views import Run as RunType
from jerkbench.contracts import Filter
from jerkbench.estimate import Updates
from jerkbench.kinematic.arguments import MARKED, SEEN, Kept, empty_runs
from jerkbench.kinematic.compiled_loop import loop_for
from jerkbench.kinematic.layout import TOTALS, run_type
from jerkbench.kinematic.models import model_of
from jerkbench.kinematic.packs import Kind, Pack, pack_runs
from jerkbench.kinematic.plugin_call import Rule, rules_of
from jerkbench.kinematic.single_run import updates_seen
from jerkbench.streamed_run import Run, Streamed

NOTHING = Updates.empty()


PackRun = Callable[[Pack, Sequence[int]], list[Streamed | None]]
"""Runs a pack: which places of the batch its WIDE runs have -> the results of its members."""


def run_batch(
    runs: Sequence[Run], models: Sequence[Filter], rules: Sequence[Rule], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run all ``runs``, each with its own filter and compiled adaptation.

    Returns one result for each: None where the run is to be repeated alone, because it diverged, came near to it, or
    its adaptation raised an error.
    """
    kinds = [
        Kind(2 + len(model.initial_variances()), rule.wants_truth, rule.dense)
        for model, rule in zip(models, rules, strict=True)
    ]

    def run_pack(pack: Pack, lanes: Sequence[int]) -> list[Streamed | None]:
        """Run one with the filters and adaptations that are its own."""
        return _run_pack(pack, [models[k] for k in lanes], [rules[k] for k in lanes], updates=updates)

    return run_packs(runs, kinds, run_pack, threads)


def run_packs(runs: Sequence[Run], kinds: Sequence[Kind], run_pack: PackRun, threads: int) -> list[Streamed | None]:
    """Pack ``runs`` by their ``kinds`` and steps, and run one pack a thread; returns one result for each run."""
    results: list[Streamed | None] = [None] * len(runs)
    packs = _packs(tuple(runs), tuple(kinds))

    def work(pack: Pack) -> None:
        """Run one pack, filled with its last run, and put the results in their places."""
        lanes = [*pack.members, *[pack.members[-1]] * (WIDE - len(pack.members))]
        for place, result in zip(pack.members, run_pack(pack, lanes), strict=True):
            results[place] = result

    if threads <= 1 or len(packs) <= 1:
        for pack in packs:
            work(pack)
    else:
        list(_pool(threads).map(work, packs))
    return results


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """To start threads takes as long as a run."""
    return ThreadPoolExecutor(threads, "jerkbench-runs")


_packs = lru_cache(maxsize=2)(pack_runs)  # for the next filter; some 10 MB for each vector of 150 s at 100 Hz


def _run_pack(pack: Pack, models: Sequence[Filter], rules: Sequence[Rule], *, updates: bool) -> list[Streamed | None]:
    model = model_of(models, pack.lengths_s, pack.timelines[0].dt0_s)
    n = 2 + len(model.extra)
    kept = room_of(pack, run_type(n, WIDE), updates=updates)
    loop = loop_for(n, WIDE, dense=rules[0].dense)
    loop(pack.steps, pack.score, model, rules_of(rules, 3 * n), kept, empty_runs(n, WIDE))
    return results_of(pack, kept, run_type(n, WIDE), updates=updates)


def room_of(pack: Pack, of: RunType, *, updates: bool) -> Kept:
    """Make room for the sums of a pack, and for what its updates saw."""
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


def results_of(pack: Pack, kept: Kept, of: RunType, *, updates: bool) -> list[Streamed | None]:
    """Return the sums of each member of a pack; None where they are not finite, or the run is lost."""
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
