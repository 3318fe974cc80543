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


def test_variational_bayes_uses_the_reported_variance_only_at_the_start():
    updates = [scalar_update(1.0, r=r) for r in (1.0, 1.0, 1.0)]
    others = [scalar_update(1.0, r=r) for r in (1.0, 50.0, 0.02)]

    np.testing.assert_array_equal(run(make("variational_bayes"), updates), run(make("variational_bayes"), others))


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


WRONG = {
    "scalar_q": [{"limit": 0.5}],
    "iae": [{"window": 0}, {"low": 0.0}],
    "mtf": [{"window": 0}],
    "mtf_block": [{"window": 0}],
    "mtf_nis": [{"probability": 1.0}],
    "federated": [{"beta": 1.0}],
    "fuzzy": [{"smoothing": 1.0}, {"large": 0.0}],
    "chi2": [{"probability": 0.0}],
    "huber_r": [{"threshold": 0.0}],
    "student_t_r": [{"nu": 0.0}],
    "variational_bayes": [{"forgetting": 1.0}, {"passes": 0}],
    "maximum_correntropy_r": [{"bandwidth": 0.0}, {"passes": 0}],
    "ssmkf_r": [{"nu": 0.0}, {"passes": 10**12}],
    "cerkf_r": [{"eta": 1.5}, {"pair_bandwidth": 0.0}, {"passes": 0}],
    "adaptive_q": [{"low": 2.0, "high": 1.0}, {"window": 0}],
    "sage_husa": [{"forgetting": 1.0}, {"low": 2.0, "high": 1.0}],
    "huber": [{"threshold": 0.0}],
    "maximum_correntropy": [{"bandwidth": 0.0}],
    "ssmkf": [{"sigma": 0.0}],
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
