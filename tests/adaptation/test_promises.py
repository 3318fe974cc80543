"""Properties of the adaptations according to their sources: closed forms, limits and long runs."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from naive import sequence
from scipy.stats import chi2

from jerkbench.adaptation.common import chi2_tail
from jerkbench.contracts import empty_memory
from jerkbench.errors import PluginError
from jerkbench.plugins import create

ONE = np.array([0])
POSITION, VELOCITY = np.arange(3), np.arange(3, 6)
EYE = np.eye(3)


def make(name, **parameters):
    return create("adaptation", {"name": name, **parameters})


def run(plugin, updates):
    memory = empty_memory(plugin)
    return [plugin.adapt(*update, memory) for update in updates]


def scalar_update(y, h=1.0, r=1.0):
    return np.array([y]), np.array([[h]]), np.array([[r]]), ONE


@pytest.mark.parametrize("rows", range(1, 7))
@pytest.mark.parametrize("probability", [0.5, 0.95, 0.99, 0.9999])
def test_the_tail_agrees_with_scipy(rows, probability):
    threshold = chi2.ppf(probability, rows)
    assert chi2_tail(threshold, rows) == pytest.approx(1 - probability, rel=1e-10)
    assert chi2_tail(1.3 * threshold, rows) == pytest.approx(chi2.sf(1.3 * threshold, rows), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "wide"),
    [
        ("student_t_r", {"nu": 1e12}),
        ("ssmkf_r", {"nu": 1e12}),
        ("maximum_correntropy_r", {"bandwidth": 1e7}),
        ("cerkf_r", {"centre_bandwidth": 1e7, "pair_bandwidth": 1e7}),
        ("huber_r", {"threshold": 1e12}),
    ],
)
def test_with_an_extreme_parameter_it_equals_none(name, wide):
    updates = list(sequence(3))
    for (_, _, R, _), adapted in zip(updates, run(make(name, **wide), updates), strict=True):
        np.testing.assert_allclose(adapted, R, rtol=1e-6, atol=1e-7 * np.max(np.diag(R)))


@pytest.mark.parametrize("name", ["scalar_r", "huber_r", "federated", "mtf_block", "mtf_nis", "chi2", "fuzzy"])
def test_a_small_innovation_changes_nothing(name):
    updates = [(0.1 * y / np.abs(y).max() * np.sqrt(np.diag(R).min()), H, R, rows) for y, H, R, rows in sequence(4)]
    for (_, _, R, _), adapted in zip(updates, run(make(name), updates), strict=True):
        np.testing.assert_array_equal(adapted, R)


def test_scalar_q_makes_the_trace_of_s_the_squared_innovation_up_to_its_limit():
    for limit in (1e3, 3.0):
        plugin, limited = make("scalar_q", limit=limit), 0
        for y, HPHt, R, rows in sequence(5):
            factor = plugin.fade(y, HPHt, R, rows, np.zeros(0))
            limited += factor == limit
            if 1 < factor < limit:
                assert np.trace(factor * HPHt + R) == pytest.approx(y @ y)
        assert limited > 5


@pytest.mark.parametrize(
    ("rule", "settled"), [(("iae", {"window": 200}), 200), (("variational_bayes", {"forgetting": 0.995}), 1000)]
)
def test_it_estimates_a_variance_that_is_larger_than_reported(rule, settled):
    name, parameters = rule
    rng = np.random.default_rng(7)
    updates = [scalar_update(y, h=2.0) for y in rng.normal(0.0, np.sqrt(11.0), 5000)]

    assert np.mean(run(make(name, **parameters), updates)[settled:]) == pytest.approx(9.0, rel=0.05)


def test_variational_bayes_uses_the_reported_variance_only_at_the_start():
    updates = [scalar_update(1.0, r=r) for r in (1.0, 1.0, 1.0)]
    others = [scalar_update(1.0, r=r) for r in (1.0, 50.0, 0.02)]

    np.testing.assert_array_equal(run(make("variational_bayes"), updates), run(make("variational_bayes"), others))


def test_only_a_gate_that_relaxes_or_counts_recovers():
    """The error is 40 sigma for the relaxing gate, which opens to 3 * 1.5^c: it exceeds 40 at c = 7."""
    update = (np.full(3, 100.0), EYE, EYE, POSITION)
    dropped = [np.isinf(np.diag(R)).all() for R in run(make("chi2"), [update] * 60)]
    assert dropped == ([True] * 25 + [False]) * 2 + [True] * 8
    off = scalar_update(40.0 * np.sqrt(2.0))
    dropped = [bool(np.isinf(R[0, 0])) for R in run(make("relaxing_gate"), [off] * 14)]
    assert dropped == [True] * 12 + [False, True]  # c - 5 = 7 at the 13th update; then the gate is narrow again


@pytest.mark.parametrize("name", ["chi2", "mtf_nis"])
def test_a_consistent_filter_triggers_at_one_percent_of_the_updates(name):
    rng = np.random.default_rng(8)
    updates = [(rng.normal(size=3) * np.sqrt(2), EYE, EYE, POSITION) for _ in range(6000)]
    changed = [not np.array_equal(R, EYE) for R in run(make(name), updates)]

    assert np.mean(changed) == pytest.approx(0.01, abs=0.004)  # three sigma


def test_huber_bounds_the_influence_of_an_outlier():
    pulls = []
    for y in (10.0, 100.0, 1000.0):
        update = scalar_update(y, h=1e-6)
        R = run(make("huber_r"), [update])[0]
        pulls.append(update[1][0, 0] / (update[1] + R)[0, 0] * y)

    np.testing.assert_allclose(pulls, pulls[0], rtol=1e-4)


def test_correntropy_rejects_a_large_outlier_but_not_a_fix_after_an_outage():
    outlier, after_outage = scalar_update(100.0, h=0.01), scalar_update(100.0, h=1e4)

    assert run(make("maximum_correntropy_r"), [outlier])[0][0, 0] > 1e8
    assert run(make("maximum_correntropy_r"), [after_outage])[0][0, 0] == pytest.approx(1.0, rel=1e-3)


def test_centred_entropy_reduces_the_weight_of_a_single_outlier_more_than_of_common_errors():
    outlier, together = np.array([30.0, 0, 0]), np.array([30.0, 30.0, 30.0])
    single = run(make("cerkf_r"), [(outlier, 0.01 * EYE, EYE, POSITION)])[0]
    shared = run(make("cerkf_r"), [(together, 0.01 * EYE, EYE, POSITION)])[0]

    assert single[0, 0] > 1e4
    assert shared[0, 0] == pytest.approx(5.0, rel=1e-3)  # 1/(1 - eta)


@pytest.mark.parametrize("h", [1e-12, 1.0, 1e12 / 3.0])
def test_the_similarity_weight_is_exact_for_any_prior(h):
    adapted = run(make("ssmkf_r"), [scalar_update(3.0, h, 2.0)])[0][0, 0]
    y, prior, reported, nu, scale = map(Decimal, (3.0, h, 2.0, 3, 1))
    with localcontext(prec=60):
        for _ in range(10):
            S = prior + scale * reported
            square = (scale * reported / S * y) ** 2 + prior - prior / S * prior
            scale = ((nu + square / reported) / (nu + 1)).sqrt()

    assert adapted == pytest.approx(float(scale * reported), rel=1e-14)


def test_adaptive_q_inflates_a_prior_that_is_too_small_and_no_other():
    rng = np.random.default_rng(9)
    for scale, low, high in [(1.0, 1.0, 1.3), (25.0, 4.2, 5.8)]:
        plugin = make("adaptive_q", window=300)
        memory = empty_memory(plugin)
        y = rng.normal(size=400) * np.sqrt(scale + 1.0)
        factors = [plugin.fade(*scalar_update(value), memory) for value in y]
        assert factors[:299] == [1.0] * 299
        assert low <= factors[-1] <= high


WRONG = {
    "scalar_q": [{"limit": 0.5}],
    "iae": [{"window": 0}, {"low": 0.0}],
    "mtf": [{"after": -1}, {"window": 0}, {"guard": -1}],
    "mtf_block": [{"window": 0}, {"guard": -1}],
    "mtf_nis": [{"guard": -1}, {"probability": 1.0}],
    "federated": [{"beta": 1.0}],
    "fuzzy": [{"smoothing": 1.0}, {"large": 0.0}],
    "chi2": [{"probability": 0.0}, {"longest": -1}],
    "huber_r": [{"threshold": 0.0}],
    "student_t_r": [{"nu": 0.0}],
    "variational_bayes": [{"forgetting": 1.0}, {"passes": 0}],
    "maximum_correntropy_r": [{"bandwidth": 0.0}, {"passes": 0}],
    "ssmkf_r": [{"nu": 0.0}, {"passes": 10**12}],
    "cerkf_r": [{"eta": 1.5}, {"pair_bandwidth": 0.0}, {"passes": 0}],
    "adaptive_q": [{"low": 2.0, "high": 1.0}, {"window": 0}],
    "sage_husa": [{"forgetting": 1.0}, {"low": 2.0, "high": 1.0}],
    "huber": [{"threshold": 0.0}, {"sides": "prior"}],
    "maximum_correntropy": [{"bandwidth": 0.0}],
    "ssmkf": [{"function": "cosh"}, {"sigma": 0.0}],
    "student_t": [{"tau": 0.0}, {"passes": 1001}],
    "vbakf_pr": [{"forgetting": 0.0}, {"tau": 0.0}, {"passes": 0}],
    "sif": [{"width": 0.0}],
    "strong_tracking": [{"softening": 0.5}, {"other": 0.0}],
    "sage_husa_qr": [{"low": 20.0, "high": 10.0}],
}


@pytest.mark.parametrize(("name", "wrong"), [(name, one) for name, each in WRONG.items() for one in each])
def test_the_message_names_a_parameter_out_of_range(name, wrong):
    with pytest.raises(PluginError, match=rf"{name}.*{next(iter(wrong))}"):
        make(name, **wrong)
