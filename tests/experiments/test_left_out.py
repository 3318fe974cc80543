"""Tuning that leaves groups out, and what replicates show, against plain loops and scipy's exact test."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from commands import experiment

left_out = experiment("journeys/left_out.py")
EACH, SETTINGS, TUNINGS, Taken = left_out.EACH, left_out.SETTINGS, left_out.TUNINGS, left_out.Taken

TAKEN = Taken(list("abcdef"), ["A", "A", "B", "C", "C", "D"], ["x", "x", "x", "y", "y", "z"])


def test_a_recording_is_scored_with_the_best_setting_of_other_groups_and_the_average_of_others():
    loss = np.random.default_rng(3).normal(size=(SETTINGS, 6))
    found = left_out.tuned_elsewhere(loss, TAKEN)
    assert found.shape == (TUNINGS, 6)
    for r, seen in enumerate(left_out.tried()):
        assert len(set(seen.tolist())) == EACH
        for k in range(6):
            means = {}
            for setting in seen:
                of = {}
                for other in range(6):
                    if TAKEN.group[other] != TAKEN.group[k]:
                        of.setdefault(TAKEN.replicate[other], []).append(loss[setting, other])
                means[setting] = np.mean([np.mean(values) for values in of.values()])
            assert found[r, k] == loss[min(means, key=means.get), k]
    rows = pd.DataFrame(
        [
            (recording, "baseline", rule, setting, error)
            for recording in "ab"
            for rule, errors in (("none", (2.0, 3.0)), ("mtf", (np.nan, 5.0)))
            for setting, error in enumerate(errors)
        ],
        columns=list(left_out.COLUMNS),
    )
    found = left_out.log_errors(rows, ["b", "a"], ("baseline", "none"))
    np.testing.assert_allclose(np.exp(found["baseline", "mtf"]), [[200.0, 200.0], [5.0, 5.0]])
    losses = {
        ("baseline", "none"): np.zeros((TUNINGS, 6)),
        ("jerk", "none"): np.ones((TUNINGS, 6)),
        ("baseline", "mtf"): np.full((TUNINGS, 6), 0.5),
        ("jerk", "mtf"): np.full((TUNINGS, 6), 1.1),
        ("baseline", "sage_husa_qr"): np.full((TUNINGS, 6), 9.0),
    }
    np.testing.assert_allclose(left_out.average_method(losses), 0.3)


def test_what_has_nothing_to_tune_is_itself_and_a_replicate_a_median():
    loss = np.arange(6.0)[None]
    np.testing.assert_array_equal(left_out.tuned_elsewhere(loss, TAKEN), np.tile(loss, (TUNINGS, 1)))
    values = np.random.default_rng(5).normal(size=(TUNINGS, 6))
    wanted = [np.median(values[:, :2]), np.median(values[:, 2]), np.median(values[:, 3:5]), np.median(values[:, 5])]
    np.testing.assert_allclose(left_out.of_replicates(values, TAKEN), wanted)


@pytest.mark.parametrize("n", [7, 13])
@pytest.mark.parametrize("shift", [0.0, -0.3, 0.9])
def test_the_exact_interval_is_that_of_the_sign_test(n, shift):
    names = [f"r{k}" for k in range(n)]
    d = np.random.default_rng(n).normal(shift, 0.4, n)
    own = left_out.over_replicates(np.tile(d, (TUNINGS, 1)), Taken(names, names, names))
    assert own.p == pytest.approx(binomtest(int((d < 0).sum()), n).pvalue)
    assert own.median == pytest.approx(np.exp(np.median(d)))
    for end, inside in zip(np.log(own.exact), (1, -1), strict=True):  # just inside the test does not reject
        assert binomtest(int((d < end + inside * 1e-9).sum()), n).pvalue > 0.05
        assert binomtest(int((d < end - inside * 1e-9).sum()), n).pvalue <= 0.05
    assert (own.p <= 0.05) == (own.exact[1] < 1.0 or own.exact[0] > 1.0)
    assert own.worst == names[int(d.argmax())]


@pytest.mark.parametrize(
    ("d", "word"),
    [
        (np.linspace(-0.09, 0.08, 13), "equal"),
        (np.linspace(-0.09, -0.02, 13), "better, by less than 10 %"),
        (np.linspace(-0.5, -0.2, 13), "better"),
        (np.linspace(0.1, 0.2, 13), "worse"),
        (np.linspace(-0.5, 0.5, 13), "undecided"),
    ],
)
def test_the_words(d, word):
    names = [str(k) for k in range(13)]
    own = left_out.over_replicates(np.tile(d, (TUNINGS, 1)), Taken(names, names, names))
    assert own.verdict == word
