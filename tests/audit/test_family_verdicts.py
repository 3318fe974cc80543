"""Verdicts family by family, against scipy and known ratios."""

import numpy as np
import pytest
from jerkbench.audit.methods import AuditMethod
from jerkbench.audit.verdicts import TUNED, Losses, family_frame, family_sentences, family_verdicts
from scipy import stats
from test_audit_verdicts import HALF, PROTOCOL, SCENARIOS

from jerkbench.audit.figures import family_figure
from jerkbench.evaluation.statistics.judgement import Verdict

METHODS = [AuditMethod("baseline", "mtf"), AuditMethod("baseline", "chi2")]
SEEDS = 12


def losses(effects, sigma=0.05):
    """Of the plain filter, and of the methods as many times that as ``effects`` says, by family."""
    rng = np.random.default_rng(5)
    plain = rng.normal(0.0, 1.0, (len(SCENARIOS), SEEDS))
    kinds = {(AuditMethod("baseline", "none"), TUNED, 0): plain}
    for method in METHODS:
        factor = np.array([effects.get((method.adaptation, scenario.family), 1.0) for scenario in SCENARIOS])
        kinds[method, TUNED, 0] = plain + np.log(factor)[:, None] + rng.normal(0.0, sigma, plain.shape)
    return Losses(tuple(HALF), SCENARIOS, kinds)


def test_intervals_are_those_of_a_t_test_for_all_pairs_at_once():
    known = losses({("mtf", "a"): 0.5})
    pairs = len(METHODS) * len(HALF)
    for verdict in family_verdicts(known, METHODS, PROTOCOL):
        ours = known.by_kind[verdict.method, TUNED, 0] - known.by_kind[AuditMethod("baseline", "none"), TUNED, 0]
        d = ours[[scenario.family == verdict.family for scenario in SCENARIOS]].mean(axis=0)
        interval = stats.ttest_1samp(d, 0.0).confidence_interval(1 - 0.05 / pairs)
        assert verdict.ratio == pytest.approx(stats.gmean(np.exp(d)), rel=1e-12)
        assert (verdict.low, verdict.high) == pytest.approx(tuple(np.exp(interval)), rel=1e-9)


def test_a_method_is_better_in_one_family_and_worse_in_another():
    known = losses({("mtf", "a"): 0.5, ("mtf", "c"): 2.0}, sigma=0.001)
    words = {(v.method.adaptation, v.family): v.verdict for v in family_verdicts(known, METHODS, PROTOCOL)}
    assert words["mtf", "a"] is Verdict.BETTER
    assert words["mtf", "c"] is Verdict.WORSE
    assert words["chi2", "a"] is Verdict.EQUAL


def test_of_noise_alone_hardly_any_study_has_a_verdict():
    """Five per cent of studies may; of 10 pairs each at 5 %, four of ten would."""
    rng = np.random.default_rng(7)
    plain = AuditMethod("baseline", "none")
    false = 0
    for _ in range(400):
        kinds = {(m, TUNED, 0): rng.normal(0.0, 0.3, (len(SCENARIOS), SEEDS)) for m in (plain, *METHODS)}
        known = Losses(tuple(HALF), SCENARIOS, kinds)
        words = {verdict.verdict for verdict in family_verdicts(known, METHODS, PROTOCOL)}
        false += bool(words & {Verdict.BETTER, Verdict.WORSE})
    assert false <= stats.binom(400, 0.05).ppf(0.999)


def test_sentences_table_and_figure_have_the_same_numbers():
    verdicts = family_verdicts(losses({("mtf", "a"): 0.5}, sigma=0.001), METHODS, PROTOCOL)
    assert family_sentences(verdicts)[0] == (
        "**a**: 1 of 2 better, 0 worse; the lowest ratio has baseline + mtf with 0.50."
    )
    assert family_frame(verdicts).query("family == 'a'")["verdict"].tolist() == ["better", "equal"]
    (axes, _) = family_figure(verdicts).axes
    assert [text.get_text() for text in axes.texts] == [f"{verdict.ratio:.2g}" for verdict in verdicts]
    assert [text.get_weight() for text in axes.texts] == ["bold"] * len(verdicts)
