"""The errors over time of a scenario's cells, for the page: one run each, made once more."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import position_error_length_m
from jerkbench.recording import Recording
from jerkbench.report.page.traces import Stretch, largest_of_steps
from jerkbench.results.replay import StoredRow, row_of
from jerkbench.results.scenario_runs import Cells, of_user, ranked, read_cells

MOST_CELLS = 40
"""Cells of a scenario whose errors are kept, the user's own and the best ones."""

KEPT = 120_000
"""Errors of all cells together: two bytes each, so that the file stays small."""

STEPS = (100, 600)
"""Fewest and most steps of a recording."""


def steps_of(scenarios: Iterable[Cells]) -> int:
    """Return into how many steps the recordings are cut, so that the errors of all cells fit.

    Args:
        scenarios: the cells of each.
    """
    lines = sum(min(len(cells), MOST_CELLS) for cells in scenarios)
    return int(np.clip(KEPT // max(1, lines), *STEPS))


def load_stretch(
    folder: Path, scenario: str, cells: Cells, metric: str, steps: int, *, run_programs: bool = False
) -> Stretch | None:
    """Run one run of each of the best and of the user's own cells again; None where the position is not known.

    Args:
        folder: the study's.
        scenario: its name.
        cells: those of the scenario.
        metric: by which they are chosen.
        steps: into how many the recording is cut.
        run_programs: whether programs of stored cells may run; without it their cells are left out.

    Raises:
        JerkbenchError: they cannot be run again.
    """
    best = ranked(read_cells(folder, cells, run_programs=run_programs), metric)
    kept = [cell.key for cell in sorted(best, key=lambda cell: not of_user(cell.metadata["spec"]))[:MOST_CELLS]]
    rows = {cell.key: row_of(cell, run_programs=run_programs) for cell in best if cell.key in kept}
    runs = {key: row.run() for key, row in rows.items() if row.row["status"] != "failed"}
    recordings = [recording for recording, _ in runs.values() if recording.reference.enu_m is not None]
    if not recordings:
        return None
    return _stretch(scenario, next(iter(rows.values())), recordings[0], runs, steps)


def _stretch(
    scenario: str, first: StoredRow, recording: Recording, runs: dict[str, tuple[Recording, Estimate]], steps: int
) -> Stretch:
    t_s = recording.reference.t_s
    edges_s = np.linspace(t_s[0], t_s[-1], min(steps, len(t_s)) + 1)
    errors_m = {
        key: largest_of_steps(seen.reference.t_s[estimate.index], position_error_length_m(estimate, seen), edges_s)
        for key, (seen, estimate) in runs.items()
    }
    draw = f"{'seed' if first.cell.seeded else 'phase'} {first.draw}"
    return Stretch(scenario, draw, float(edges_s[0]), float(edges_s[1] - edges_s[0]), recording.outages_s, errors_m)
