"""The error of a filter without an IMU beside fixes, and in the gaps between them.

Usage: python experiments/degraded/gaps.py FOLDER [--dataset hamburg] [--filter constant_velocity]

A table over the stamps of the reference by the time since the last fix: the RMSE of the filter (3-D and in the plane),
its largest error, and its share of all squared errors; below it the RMSE of the fixes themselves.
"""

import argparse
import itertools

import numpy as np

from jerkbench import plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import FloatArray
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import no_attitude
from jerkbench.presets import preset
from jerkbench.recording import Recording
from jerkbench.timeline import build_timeline

AGES_S = (0.0, 0.5, 3.0, 10.0, 30.0, np.inf)
"""Bounds of the rows of the table."""

BURN_IN_S = 5.0
"""The study's, and jerkbench's default."""


def errors(recording: Recording, model: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return errors of the filter (k, 3), ages of the last fix (k,), errors of fixes at the same time (k, 3) or NaN.

    After the burn-in, as the study counts.
    """
    position, truth = recording.position, recording.reference
    if position is None or truth.enu_m is None:
        raise ValueError(f"{recording.name} needs fixes and a reference of the position.")
    timeline = build_timeline(recording, no_attitude(position.t_s))
    estimate = FilterpyEngine().run(timeline, plugins.create("filter", {"name": model}), NoAdaptation())
    counted = estimate.index[truth.t_s[estimate.index] >= BURN_IN_S]
    t_s, true_m, at_m = truth.t_s[counted], truth.enu_m[counted], estimate.position_m[-len(counted) :]
    last = np.searchsorted(position.t_s, t_s + 1e-6) - 1
    age_s = np.maximum(t_s - position.t_s[last], 0.0)
    of_fix = np.where(age_s[:, None] < 1e-3, position.enu_m[last] - true_m, np.nan)
    return at_m - true_m, age_s, of_fix


def rmse(error_m: FloatArray) -> float:
    """Root of the mean squared length of the rows."""
    return float(np.sqrt((error_m**2).sum(axis=1).mean()))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", help="the recording's folder")
    parser.add_argument("--dataset", default="hamburg", help="its preset (default hamburg)")
    parser.add_argument("--filter", default="constant_velocity", help="the filter (default constant_velocity)")
    asked = parser.parse_args()
    dataset = plugins.create("dataset", {**preset("dataset", asked.dataset), "folder": asked.folder})
    error_m, age_s, of_fix_m = errors(dataset.load(0), asked.filter)
    squares = (error_m**2).sum(axis=1)
    print(f"{'since the last fix [s]':<24}{'stamps':>8}{'RMSE [m]':>10}{'in plane':>10}{'largest':>10}{'share':>8}")
    for low, high in itertools.pairwise(AGES_S):
        rows = (age_s >= low) & (age_s < high)
        if rows.any():
            largest, share = np.sqrt(squares[rows].max()), squares[rows].sum() / squares.sum()
            print(f"{f'{low:g} to {high:g}':<24}{rows.sum():>8}{rmse(error_m[rows]):>10.2f}", end="")
            print(f"{rmse(error_m[rows, :2]):>10.2f}{largest:>10.1f}{share:>8.1%}")
    print(f"{'all':<24}{len(squares):>8}{rmse(error_m):>10.2f}{rmse(error_m[:, :2]):>10.2f}")
    of_fix_m = of_fix_m[np.isfinite(of_fix_m[:, 0])]
    if len(of_fix_m):
        print(f"{'the fixes themselves':<24}{len(of_fix_m):>8}{rmse(of_fix_m):>10.2f}{rmse(of_fix_m[:, :2]):>10.2f}")


if __name__ == "__main__":
    main()
