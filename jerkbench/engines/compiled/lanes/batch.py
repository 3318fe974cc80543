"""Many runs from Python: packs of WIDTH runs that share their steps, one pack a thread."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import WIDTH
from jerkbench.contracts import Adaptation, Filter
from jerkbench.engines.compiled.lanes.entry import lanes_for
from jerkbench.engines.compiled.lanes.loop import SEEN, LaneKept, LaneModel
from jerkbench.engines.compiled.lanes.packs import Pack, pack_runs
from jerkbench.engines.compiled.lanes.places import TOTALS, places
from jerkbench.engines.compiled.models import model_of
from jerkbench.engines.compiled.rule import CompiledRule
from jerkbench.estimate import Updates
from jerkbench.streamed import Run, Streamed


def run_batch(
    runs: Sequence[Run], model: Filter, adaptation: Adaptation, compiled: CompiledRule, *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run ``model`` with the compiled adaptation over all ``runs``.

    Returns one result for each: None where the run is to be repeated alone, because it diverged or came near to it, or
    because the model is none that this loop knows.
    """
    truth = getattr(adaptation, "wants_true_covariance", False)
    found: list[Streamed | None] = [None] * len(runs)
    packs = _packs(tuple(runs), truth)

    def work(pack: Pack) -> None:
        for place, result in zip(pack.members, _run_pack(pack, model, compiled, updates=updates), strict=False):
            found[place] = result

    if threads <= 1 or len(packs) == 1:
        for pack in packs:
            work(pack)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, packs))
    return found


_packs = lru_cache(maxsize=2)(pack_runs)  # for the next filter; some 10 MB for each vector of 150 s at 100 Hz


def _run_pack(pack: Pack, model: Filter, compiled: CompiledRule, *, updates: bool) -> list[Streamed | None]:
    prepared = model_of(pack.timelines[0], model, pack.lengths_s)
    if not prepared.triangular:
        return [None] * WIDTH
    n = prepared.A.shape[1]
    lane_model = LaneModel(prepared.A, prepared.b, prepared.Q, np.asarray(model.initial_variances(), dtype=np.float64))
    rows = len(pack.steps.z) if updates else 1
    kept = LaneKept(
        np.zeros(places(n)["ALL"] * WIDTH),
        np.zeros((WIDTH, len(compiled.rule.memory))),
        np.zeros((int(pack.steps.mark.max(initial=-1)) + 1, 3, WIDTH)),
        np.full((max(rows, 1), SEEN, WIDTH), np.nan),
        np.zeros(114),
        np.zeros(6, dtype=np.int64),
    )
    rule = compiled.rule
    lanes_for(n)(compiled.adapt, compiled.fade, pack.steps, lane_model, rule.parameters, rule.fades, kept)
    return _results(pack, kept, places(n), updates=updates)


def _results(pack: Pack, kept: LaneKept, at: dict[str, int], *, updates: bool) -> list[Streamed | None]:
    w = kept.w.reshape(-1, WIDTH)
    totals = {name: w[at[name]] for name in TOTALS}
    healthy = np.isfinite(np.array(list(totals.values()))).all(axis=0) & (w[at["ODD"]] == 0.0)
    return [
        _result(pack, kept, w, at, lane, updates=updates) if healthy[lane] else None
        for lane in range(len(pack.members))
    ]


def _result(pack: Pack, kept: LaneKept, w: FloatArray, at: dict[str, int], lane: int, *, updates: bool) -> Streamed:
    total = {name: float(w[at[name], lane]) for name in TOTALS}
    return Streamed(
        position_m2=w[at["EAST"] : at["EAST"] + 3, lane].copy(),
        velocity_m2ps2=w[at["VEAST"] : at["VEAST"] + 3, lane].copy(),
        whole_m2=total["WHOLE"],
        outage_m2=total["OUTAGE"],
        largest_m2=total["LARGEST"],
        farthest_m2=total["FARTHEST"],
        nees=total["NEES"],
        nees_position=total["NEES_POSITION"],
        nis_per_row=total["NIS"],
        nis_updates=total["UPDATES"],
        nis_used_per_row=total["NIS_USED"],
        nis_used_updates=total["UPDATES_USED"],
        marked_m=kept.errors[pack.marks[lane], :, lane],
        updates=_updates(pack, kept.seen, lane) if updates else Updates.empty(),
    )


def _updates(pack: Pack, seen: FloatArray, lane: int) -> Updates:
    """What the updates of one run saw; it may lack some that others have."""
    there = seen[:, 0, lane] > 0
    mine = seen[there, :, lane]
    absent = pack.steps.kept[there, :, lane] == 0.0
    return Updates(
        pack.update_s[there],
        mine[:, 0],
        mine[:, 1],
        np.where(mine[:, 2] > 0, mine[:, 3], np.nan),
        np.where(absent, np.nan, mine[:, 4:10]),
        np.where(absent, np.nan, mine[:, 10:]),
    )
