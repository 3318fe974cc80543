"""Losses of an audit whose answers are known: made by hand, no filter runs."""

import dataclasses

import numpy as np
from jerkbench.audit.methods import AuditMethod
from jerkbench.audit.verdicts import DEFAULTS, TUNED, Losses

from jerkbench.audit.protocol import read_protocol
from jerkbench.campaigns.protocol import FaultFamily

FAMILIES = ("none", "a", "b")
CLAIMED, AGAINST = AuditMethod("jerk", "mtf"), AuditMethod("baseline", "none")
PROTOCOL = dataclasses.replace(
    read_protocol("small"),
    filters=("baseline",),
    families=tuple(
        FaultFamily(name, half, "none", {"usual": {}})
        for name, half in zip(FAMILIES, ("both", "first", "second"), strict=True)
    ),
)
SCENARIOS = PROTOCOL.scenarios
"""White none, a, b; coloured none, a, b."""

JERK = {"none": 1.2, "a": 0.05, "b": 0.5}
"""Its error over the baseline's, tuned, by family; with white noise."""


def losses(jerk=JERK, coloured=1.0):
    rng = np.random.default_rng(5)
    common = rng.normal(0.0, 0.3, (6, 20))
    ratios = np.array([jerk[s.family] * (coloured if s.noise == "coloured" else 1.0) for s in SCENARIOS])
    own = common + np.log(ratios)[:, None] + rng.normal(0.0, 0.01, common.shape)
    known = {
        (AGAINST, DEFAULTS, 0): common + np.log(2.0),
        (AGAINST, TUNED, 0): common,
        (CLAIMED, DEFAULTS, 0): own + np.log(2.0),
        (CLAIMED, TUNED, 0): own,
        (AuditMethod("gnss_only", "none"), TUNED, 0): common + np.log(3.0),
        (AuditMethod("baseline", "oracle"), TUNED, 0): common + np.log(0.25),
    }
    return Losses(FAMILIES, SCENARIOS, known)
