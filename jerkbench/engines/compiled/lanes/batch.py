"""Many runs from Python: packs of WIDTH runs that share their steps, one pack a thread."""

from collections.abc import Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from typing import cast

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.batch import Run, Streamed
from jerkbench.compilation.vectors import WIDTH, aligned_zeros
from jerkbench.contracts import Adaptation, Filter
from jerkbench.engines.compiled.arguments import Rule
from jerkbench.engines.compiled.lanes.arguments import SEEN, LaneKept, LaneModel
from jerkbench.engines.compiled.lanes.entry import lanes_for
from jerkbench.engines.compiled.lanes.packs import Pack, pack_runs
from jerkbench.engines.compiled.lanes.places import TOTALS, places
from jerkbench.engines.compiled.lanes.runs import empty_runs
from jerkbench.engines.compiled.models import axis_models, triangular
from jerkbench.estimate import Updates

NOTHING = Updates.empty()


def run_batch(
    runs: Sequence[Run], model: Filter, adaptation: Adaptation, rule: Rule, *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run ``model`` with the compiled ``rule`` over all ``runs``.

    Returns one result for each: None where the run is to be repeated alone, because it diverged or came near to it, or
    because the model is none that this loop knows.
    """
    truth = getattr(adaptation, "wants_true_covariance", False)
    found: list[Streamed | None] = [None] * len(runs)
    packs = _packs(tuple(runs), truth)

    def work(pack: Pack) -> None:
        for place, result in zip(pack.members, _run_pack(pack, model, rule, updates=updates), strict=False):
            found[place] = result

    if threads <= 1 or len(packs) == 1:
        for pack in packs:
            work(pack)
    else:
        list(_pool(threads).map(work, packs))
    return found


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """To start threads takes as long as a run."""
    return ThreadPoolExecutor(threads, "jerkbench-runs")


_packs = lru_cache(maxsize=2)(pack_runs)  # for the next filter; some 10 MB for each vector of 150 s at 100 Hz


def _run_pack(pack: Pack, model: Filter, rule: Rule, *, updates: bool) -> list[Streamed | None]:
    lane_model = _model_for(model, pack)
    if lane_model is None:
        return [None] * WIDTH
    n, at = lane_model.A.shape[1], places(lane_model.A.shape[1])
    rows = len(pack.steps.z) if updates else 1
    kept = LaneKept(
        aligned_zeros(at["ALL"] * WIDTH),
        np.zeros((WIDTH, len(rule.memory))),
        np.zeros((int(pack.steps.mark.max(initial=-1)) + 1, 3, WIDTH)),
        np.full((max(rows, 1), SEEN, WIDTH), np.nan),
        empty_runs(),
        np.zeros(114),
        np.zeros(6, dtype=np.int64),
    )
    lanes_for(n)(pack.steps, lane_model, rule, kept)
    return _results(pack, kept, at, updates=updates)


def _model_for(model: Filter, pack: Pack) -> LaneModel | None:
    given = pack.lengths_s.tobytes(), pack.timelines[0].dt0_s
    params = getattr(model, "__dataclass_params__", None)
    return _known(cast("Hashable", model), *given) if params and params.frozen else _lane_model(model, *given)


def _lane_model(model: Filter, lengths_s: bytes, dt0_s: float) -> LaneModel | None:
    """Ask the filter for A, b, Q of each length; None where the loop does not know such an A."""
    A, b, Q = axis_models(model, np.frombuffer(lengths_s), dt0_s)
    return LaneModel(A, b, Q, np.array(model.initial_variances(), dtype=np.float64)) if triangular(A) else None


@lru_cache(maxsize=32)  # even steps: the same for all packs; uneven ones: each seed has its own, for all adaptations
def _known(model: Hashable, lengths_s: bytes, dt0_s: float) -> LaneModel | None:
    return _lane_model(cast("Filter", model), lengths_s, dt0_s)


def _results(pack: Pack, kept: LaneKept, at: dict[str, int], *, updates: bool) -> list[Streamed | None]:
    w = kept.w.reshape(-1, WIDTH)
    totals = w[[at[name] for name in TOTALS]]
    healthy = np.isfinite(totals).all(axis=0) & (w[at["ODD"]] == 0.0)
    lanes = [dict(zip(TOTALS, numbers, strict=True)) for numbers in totals.T.tolist()]
    return [
        _result(pack, kept, lanes[lane], lane, updates=updates) if healthy[lane] else None
        for lane in range(len(pack.members))
    ]


def _result(pack: Pack, kept: LaneKept, total: dict[str, float], lane: int, *, updates: bool) -> Streamed:
    return Streamed(
        position_m2=np.array([total["EAST"], total["NORTH"], total["UP"]]),
        velocity_m2ps2=np.array([total["VEAST"], total["VNORTH"], total["VUP"]]),
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
        updates=_updates(pack, kept.seen, lane) if updates else NOTHING,
    )


def _updates(pack: Pack, seen: FloatArray, lane: int) -> Updates:
    """What the updates of one run saw; it may lack some that others have."""
    seen = seen[: len(pack.steps.z)]  # of no update there is a row all the same
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
