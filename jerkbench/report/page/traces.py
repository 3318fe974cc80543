"""Errors over time as a page carries them: the largest of each step, two bytes each."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray

LOWEST, HIGHEST = 1e-9, 1e9
"""Metres between which an error is told; beyond them it is set to the nearest."""

LEVELS = 65534
"""Steps of the logarithm: neighbours are 0.06 % apart."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """The errors of several cells over the same recording.

    Attributes:
        scenario: name of the scenario.
        draw: which run it is, such as "seed 0".
        start_s: begin of the first step.
        step_s: length of a step.
        outages_s: (k, 2) begin and end of each outage.
        errors_m: key of the cell -> (n,) largest length of the position error in each step, NaN where there is none.
    """

    scenario: str
    draw: str
    start_s: float
    step_s: float
    outages_s: FloatArray
    errors_m: Mapping[str, FloatArray]


def largest_of_steps(t_s: FloatArray, error_m: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return (n,) the largest of ``error_m`` (k,) in each step between ``edges_s`` (n + 1,); NaN in one without any."""
    known = np.isfinite(error_m)
    place = np.clip(np.searchsorted(edges_s, t_s[known], side="right") - 1, 0, len(edges_s) - 2)
    largest = np.full(len(edges_s) - 1, -np.inf)
    np.maximum.at(largest, place, error_m[known])
    return np.where(np.isinf(largest), np.nan, largest)


def encoded(error_m: FloatArray) -> str:
    """Return errors [m] as text: of each the logarithm in 65534 steps from 1 on, 0 where there is none; base64."""
    span = np.log10(HIGHEST / LOWEST)
    with np.errstate(invalid="ignore"):
        share = np.log10(np.clip(error_m, LOWEST, HIGHEST) / LOWEST) / span
    steps = np.where(np.isnan(share), 0, 1 + np.round(np.nan_to_num(share) * LEVELS))
    return base64.b64encode(steps.astype("<u2").tobytes()).decode()


def payload(stretches: Sequence[Stretch], styles: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """Return what the page's script reads.

    Args:
        stretches: of each scenario.
        styles: colour and dashes of each cell's line, by key.
        names: of each cell's method, by key.
    """
    return {
        "lowest": LOWEST,
        "decades": float(np.log10(HIGHEST / LOWEST)),
        "levels": LEVELS,
        "scenarios": [_told(stretch, styles, names) for stretch in stretches if stretch.errors_m],
    }


def _told(stretch: Stretch, styles: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    lines = [
        {"key": key, "name": names[key], **styles[key], "error": encoded(error)}
        for key, error in stretch.errors_m.items()
    ]
    outages = np.round(stretch.outages_s, 3).tolist()
    place = {"start": round(stretch.start_s, 6), "step": round(stretch.step_s, 6)}
    return {"name": stretch.scenario, "draw": stretch.draw, **place, "outages": outages, "lines": lines}
