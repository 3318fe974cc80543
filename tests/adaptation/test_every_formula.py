"""Each adaptation against a second implementation, over random sequences with varying rows."""

from decimal import Decimal, localcontext
from functools import partial

import naive
import numpy as np
import pytest
from naive import diagonal_sequence, sequence

from decimals import cholesky, exact, numbers, solve
from jerkbench.contracts import empty_memory
from jerkbench.plugins import create

ADAPT = {
    "mtf": lambda: naive.NaiveMtf(naive.total_test),
    "mtf_block": lambda: naive.NaiveMtf(naive.block_test),
    "mtf_nis": lambda: naive.NaiveMtf(naive.nis_test),
    "iae": naive.NaiveIae,
    "federated": lambda: naive.naive_federated(0.5),
    "fuzzy": naive.NaiveFuzzy,
    "chi2": naive.NaiveChi2,
    "huber_r": lambda: naive.naive_huber,
    "igg3": lambda: naive.naive_igg3,
    "relaxing_gate": naive.NaiveRelaxingGate,
    "student_t_r": lambda: naive.naive_student_t,
    "variational_bayes": naive.NaiveVariationalBayes,
    "ssmkf_r": lambda: naive.naive_similarity,
}
"""Plugins whose formulas apply to a full R."""

FADE = [
    ("scalar_q", {}, lambda: naive.naive_scalar_q),
    ("scalar_q", {"limit": 3.0}, lambda: partial(naive.naive_scalar_q, limit=3.0)),
    ("adaptive_q", {}, lambda: naive.NaiveAdaptiveQ(20)),
    ("adaptive_q", {"window": 5}, lambda: naive.NaiveAdaptiveQ(5)),
]


def assert_agree(plugin, oracle, updates):
    memory = empty_memory(plugin)
    changed = 0
    for y, HPHt, R, rows in updates:
        adapted = plugin.adapt(y, HPHt, R, rows, memory)
        wanted = oracle(naive.Update(y, HPHt, R, rows))[np.ix_(rows, rows)]
        finite = np.isfinite(wanted)
        np.testing.assert_array_equal(np.isfinite(adapted), finite)
        scale = np.sqrt(np.outer(np.diag(R), np.diag(R)))
        np.testing.assert_allclose((adapted / scale)[finite], (wanted / scale)[finite], rtol=1e-9, atol=1e-11)
        changed += not np.array_equal(adapted, R)
    assert changed > 5, "the sequence asks nothing of it"


EXPONENTIAL = {"maximum_correntropy_r": 1.0, "cerkf_r": 0.8}
"""Adaptations with exponential weights, and the weight eta of the kernel of single rows."""


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ADAPT)
def test_it_agrees_with_the_second_implementation(name, seed):
    assert_agree(create("adaptation", {"name": name}), ADAPT[name](), sequence(seed))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("name", "eta"), EXPONENTIAL.items())
def test_exponential_weights_agree_with_sixty_digits(name, eta, seed):
    """In double precision the information form has an error of 2e-7 if a weight is 1e-9, on some processors."""
    plugin = create("adaptation", {"name": name})
    changed = 0
    for y, HPHt, R, rows in [*sequence(seed, 60, largest=9.0), *diagonal_sequence(seed + 10, 60, largest=9.0)]:
        adapted = plugin.adapt(y, HPHt, R, rows, np.zeros(0))
        with localcontext(prec=60):
            wanted = numbers(reweighted_exactly(*map(exact, (y, HPHt, R)), Decimal(eta)))
        scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
        assert np.abs((adapted - wanted) / scale).max() < 1e-11
        changed += not np.array_equal(adapted, R)
    assert changed > 5, "the sequence asks nothing of it"


@pytest.mark.parametrize(("name", "eta"), EXPONENTIAL.items())
def test_weights_agree_with_sixty_digits_if_one_weight_is_tiny(name, eta):
    """With a variance of 1e9 R in one row, the other rows had only eight correct digits."""
    plugin = create("adaptation", {"name": name})
    for y, larger, R, rows in sequence(0, 40, largest=30.0):
        HPHt = 1e-4 * larger
        with localcontext(prec=60):
            wanted = numbers(reweighted_exactly(*map(exact, (y, HPHt, R)), Decimal(eta)))
        scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
        difference = (plugin.adapt(y, HPHt, R, rows, np.zeros(0)) - wanted) / scale
        assert np.abs(difference).max() < 1e-10


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("name", "parameters", "oracle"), FADE)
def test_the_factor_on_the_prior_agrees_with_the_second_implementation(name, parameters, oracle, seed):
    plugin, oracle = create("adaptation", {"name": name, **parameters}), oracle()
    memory, factors = empty_memory(plugin), []
    for update in sequence(seed, length=200):
        factors.append(plugin.fade(*update, memory))
        assert factors[-1] == pytest.approx(oracle(naive.Update(*update)), rel=1e-12)
        assert plugin.adapt(*update, memory) is update[2]
    assert max(factors) > 2
    assert min(factors) == 1


OTHER_PARAMETERS = [
    ("mtf", {"window": 4, "guard": 2}, partial(naive.NaiveMtf, naive.total_test)),
    ("mtf_block", {"window": 4, "guard": 2}, partial(naive.NaiveMtf, naive.block_test)),
    ("mtf_nis", {"window": 4, "guard": 2}, partial(naive.NaiveMtf, naive.nis_test)),
    ("iae", {"window": 4}, naive.NaiveIae),
    ("chi2", {"probability": 0.9, "longest": 2}, naive.NaiveChi2),
    ("relaxing_gate", {"width": 2.0, "patience": 2}, naive.NaiveRelaxingGate),
    ("variational_bayes", {"forgetting": 0.9}, naive.NaiveVariationalBayes),
]


@pytest.mark.parametrize(("name", "parameters", "oracle"), OTHER_PARAMETERS)
def test_other_parameters_agree_too(name, parameters, oracle):
    plugin = create("adaptation", {"name": name, **parameters})
    assert_agree(plugin, oracle(**parameters), sequence(11, length=300))


def reweighted_exactly(y, HPHt, R, eta):
    """R after five passes with the default bandwidth of 5."""
    L, adapted, m = cholesky(R), R, len(y)
    for _ in range(5):
        e = solve(L, adapted @ solve(HPHt + adapted, y))
        centre = [(-(each**2) / 50).exp() for each in e]
        pairs = [sum((-((a - b) ** 2) / 50).exp() for b in e) - 1 for a in e]
        share = eta if m > 1 else 1
        weights = [share * c + (1 - share) * p / max(m - 1, 1) for c, p in zip(centre, pairs, strict=True)]
        adapted = L / np.array([max(w, Decimal("1e-9")) for w in weights]) @ L.T
    return adapted
