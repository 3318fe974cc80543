"""Comparisons from losses whose answers are known: made by hand, no filter runs."""

import dataclasses

import numpy as np
import pytest
from jerkbench.audit.methods import AuditMethod
from jerkbench.audit.verdicts import TUNED

from jerkbench.audit.answer import (
    model_sentence,
    noise_sentence,
    off_by,
    power_sentence,
    reference_sentences,
    tuning_sentence,
)
from jerkbench.evaluation.statistics.ranks import over_scenarios
from made_losses import AGAINST, CLAIMED, JERK, PROTOCOL, losses


def test_tuning_and_references_have_the_ratios_that_were_put_in():
    assert tuning_sentence(losses(), PROTOCOL).endswith("by 0.50 (0.50 to 0.50) (baseline).")
    floor, oracle = reference_sentences(losses(), PROTOCOL)
    assert floor == "GNSS alone has 3.00 (3.00 to 3.00) of the error of baseline + none, tuned."
    assert oracle.startswith("The same filter told the true R has 0.25 (0.25 to 0.25)")


def test_a_consistent_filter_is_off_by_nothing_and_both_sides_count_alike():
    assert off_by(6.0) == 0.0
    assert off_by(3.0) == pytest.approx(off_by(12.0)) == pytest.approx(np.log(2.0))


@dataclasses.dataclass(frozen=True)
class Judged:
    """What two sentences read of a verdict."""

    method: AuditMethod
    low: float = 0.5
    high: float = 2.0
    tuned: object = dataclasses.field(default_factory=lambda: over_scenarios(np.array([[-0.1, 0.1], [0.1, 0.3]])))


def test_white_and_coloured_noise_are_told_apart():
    """Three methods: 0.31, twice and three times that with coloured noise only, so that two change sides."""
    known = losses()
    names = [AuditMethod("baseline", f"r{k}") for k in (1, 4, 6)]
    for method, factor in zip(names, (1, 4, 6), strict=True):
        jerk = {family: ratio * (1 + factor / 100) for family, ratio in JERK.items()}
        known.by_kind[method, TUNED, 0] = losses(jerk, factor).by_kind[CLAIMED, TUNED, 0]
    text = noise_sentence(known, [Judged(method) for method in names], PROTOCOL)
    assert "3 of 3 with white noise, 1 of 3 with coloured noise; 2 change sides" in text
    assert "baseline + r1 with coloured noise. Rank correlation of the two orders: 1.00." in text


def test_another_model_is_told_from_an_adaptation():
    """jerk without adaptation at half of the baseline's error everywhere, imm at a fifth; eskf15 was not run."""
    known = losses()
    for name, ratio in (("jerk", 0.5), ("imm", 0.2)):
        known.by_kind[AuditMethod(name, "none"), TUNED, 0] = known.by_kind[AGAINST, TUNED, 0] + np.log(ratio)
    protocol = dataclasses.replace(PROTOCOL, filters=("baseline", "jerk"), apart=("imm", "eskf15"))
    text = model_sentence(known, protocol)
    assert text.endswith("another model has: jerk 0.50 (0.50 to 0.50), imm 0.20 (0.20 to 0.20).")
    assert model_sentence(known, PROTOCOL) == ""


def test_the_power_is_that_of_the_interval_in_the_middle():
    text = power_sentence([Judged(CLAIMED)] * 3, PROTOCOL)
    assert "there are 3 families" in text
    assert "a factor of 2.00 either way" in text
    assert "below 0.50" in text
