"""Rows of an audit or a study whose numbers are made, not run: as many methods, tunings and drives as a test needs."""

import dataclasses

import numpy as np
import pandas as pd

from jerkbench.campaign.audit import JUDGED, AuditRows
from jerkbench.campaign.protocol import read_protocol
from jerkbench.plugins import create

SMALL = dataclasses.replace(
    read_protocol("small"), tunings=4, tune_drives=5, judged_drives=160, apart_tunings=4, apart_drives=40
)
LOST = 0.02
"""The share of lost runs."""
FACTORS = {
    "dataset": "field",
    "disturbance": "none",
    "attitude": "tilt",
    "noise": "default",
    "replicate": "seed",
    "status": "ok",
    "reason": "",
}
"""What all rows of a study have in common."""


def cell_rows(filter_name, adaptation, values, **more):
    """The rows of a combination as a sweep stores them, one for each value."""
    head = {**FACTORS, "filter": filter_name, "adaptation": adaptation, **more}
    return [{**head, "seed": seed, "position_rmse_m": value} for seed, value in enumerate(values)]


def study_rows(seeds, times):
    """Rows of two filters and mtf in two scenarios, mtf so many times better than the baseline."""
    rng, made = np.random.default_rng(5), []
    for name, adaptation, factor in (("baseline", "none", 1.0), ("jerk", "none", 0.9), ("jerk", "mtf", 1 / times)):
        for disturbance in ("none", "bias"):
            values = factor * np.exp(0.1 * rng.standard_normal(seeds))
            made += cell_rows(name, adaptation, values, disturbance=disturbance)
    return pd.DataFrame(made)


def made_rows(protocol=SMALL, seed=0, ratio=None):
    """Rows with a log ratio for each (filter, adaptation), and luck of drives, tunings and runs."""
    rng, ratio = np.random.default_rng(seed), ratio or {}
    dataset = create("dataset", dict(protocol.laws))
    uses = [(seed, r) for r in range(protocol.tunings) for seed in protocol.seeds_to_tune_on(r)]
    uses += [(seed, JUDGED) for seed in protocol.seeds_to_judge_on]
    level = dict(zip([seed for seed, _ in uses], rng.normal(-3.0, 0.8, len(uses)), strict=True))
    drives = pd.DataFrame([{"seed": s, "tuning": r, "level": level[s], **dataset.columns(s)} for s, r in uses])
    tuned, judged, settings = [], [], []
    for method in [*protocol.competing, *protocol.separate]:
        mean, luck = ratio.get(tuple(method), 0.0), dict(zip(level, rng.normal(0.0, 0.3, len(level)), strict=True))
        searches = max(protocol.searches(method))
        for tuning in protocol.tunings_of(method):
            head = {**method._asdict(), "tuning": tuning}
            for trial in range(searches):
                loss = -3.0 + mean + rng.normal(0.0, 0.2)
                tuned.append({**head, "trial": trial, "drives": protocol.tune_drives, "lost": 0, "loss": loss})
            own = [(tried, mean + rng.normal(0.0, 0.05)) for tried in protocol.searches(method)]
            settings += [{**head, "tried": tried, "knob": "adaptation.window", "value": value} for tried, value in own]
            for tried, value in [(1, mean + 0.4), *own] if tuning == 0 else own:
                best = min((row["loss"], row["trial"]) for row in tuned[-searches:][:tried])
                run = {**head, "tried": tried, "trial": 0 if tried == 1 else best[1]}
                for drive in protocol.judges(method):
                    error = level[drive] + luck[drive] + value + rng.normal(0.0, 0.1)
                    lost = rng.random() < LOST
                    ended = {"status": "diverged" if lost else "ok", "log_error": np.nan if lost else error}
                    judged.append({**run, "seed": drive, **ended})
    return AuditRows(protocol, drives, pd.DataFrame(tuned), pd.DataFrame(judged), pd.DataFrame(settings))
