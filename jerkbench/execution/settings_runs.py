"""Many settings of one method over one scenario: recordings, attitudes and timelines are made once for all of them."""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

from jerkbench.cells.cell import Cell
from jerkbench.contracts import Estimator, Filter, SettingsSideBySide, SideBySide
from jerkbench.evaluation.divergence import strays
from jerkbench.execution.batches import Prepared, prepared, streamed_values, streams
from jerkbench.execution.cell_run import CellRun, Row
from jerkbench.execution.inputs import Inputs
from jerkbench.optional import part_read
from jerkbench.streamed_run import RecordedRun, Run, Streamed
from jerkbench.timeline.reported_noise import AS_REPORTED, told_timeline


class Place(NamedTuple):
    """One run among those of all settings."""

    cell: Cell
    draw: int
    seed: Prepared


def run_settings(
    cells: Sequence[Cell], draws: Sequence[int], fingerprint: str, threads: int, inputs: Inputs
) -> list[list[Row]]:
    """Return the rows of each cell, one for each of ``draws``, as `CellRun` has them.

    Args:
        cells: they differ in filter (of one class), adaptation and r_scale alone.
        draws: seeds, or phases.
        fingerprint: of their data.
        threads: how many the engine may use.
        inputs: recordings, attitudes and timelines that are shared.
    """
    first = cells[0]
    one_by_one = isinstance(first.filter, Estimator) and not isinstance(first.filter, SettingsSideBySide)
    if one_by_one or not all(map(streams, cells)):
        return [CellRun(cell, fingerprint, threads=threads, inputs=inputs).rows(draws)[0] for cell in cells]
    base = dataclasses.replace(first, r_scale=AS_REPORTED)
    ready = {draw: prepared(base, draw, fingerprint, inputs) for draw in draws}
    places = [Place(cell, draw, seed) for cell in cells for draw, seed in ready.items() if seed is not None]
    streamed = dict(zip(((id(p.cell), p.draw) for p in places), _streamed(places, threads, inputs), strict=True))
    return [
        [_row(cell, draw, ready[draw], streamed.get((id(cell), draw)), fingerprint, inputs) for draw in draws]
        for cell in cells
    ]


def _streamed(places: Sequence[Place], threads: int, inputs: Inputs) -> Sequence[Streamed | None]:
    """Run all of them in one call, of the estimator or of the engine."""
    if not places:
        return []
    first = places[0].cell
    adaptations = [place.cell.adaptation for place in places]
    reads = {part_read(metric) for metric in first.metrics}
    updates, attitude = "updates" in reads, "attitude" in reads
    if isinstance(first.filter, SettingsSideBySide):
        recorded = [_recorded(place, inputs) for place in places]
        estimators: Any = [place.cell.filter for place in places]  # of one class, as `run_settings` says
        run = first.filter.run_settings
        return run(recorded, estimators, adaptations, updates=updates, attitude=attitude, threads=threads)
    models = [cast("Filter", place.cell.filter) for place in places]
    engine = cast("SideBySide", first.engine)
    return engine.run_many([_run(place) for place in places], models, adaptations, updates=updates, threads=threads)


def _run(place: Place) -> Run:
    seed = place.seed
    timeline = told_timeline(seed.timeline, seed.recording, seed.attitude, place.cell.r_scale)
    return Run(timeline, seed.scored.scoring)


def _recorded(place: Place, inputs: Inputs) -> RecordedRun:
    told = inputs.told(place.seed.recording, place.cell.r_scale)
    timeline, scoring = _run(place)
    return RecordedRun(told, place.seed.attitude, timeline, scoring)


def _row(
    cell: Cell, draw: int, seed: Prepared | None, result: Streamed | None, fingerprint: str, inputs: Inputs
) -> Row:
    """The row of a run; one that stopped, or went too far, is run alone, which says where and when."""
    if seed is None or result is None or strays(result, cell.protocol.divergence_limit_m):
        (row,), _ = CellRun(cell, fingerprint, inputs=inputs).rows([draw])
        return row
    return {"seed": draw, "status": "ok", **streamed_values(cell, seed, result, inputs)}
