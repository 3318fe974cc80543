"""The page on attitude filters against the kept rows."""

import numpy as np
import pandas as pd
import pytest

from commands import EXPERIMENTS, experiment

page = experiment("attitude/page.py")
from tables import TUNINGS, errors_of, holm, losses_on, settings_left_out, tried, verdicts_on  # noqa: E402 - next to the page
from trials import METHODS, SETTINGS, all_trials, error_deg  # noqa: E402 - next to the page


@pytest.fixture(scope="module")
def errors():
    return page.stored_errors()


def test_the_tables_of_the_page_are_those_of_the_rows_of_every_method_setting_and_trial(errors):
    text = (EXPERIMENTS / "attitude" / "README.md").read_text(encoding="utf-8")
    assert page.filled(text, errors) == text
    counts = {
        "broad": (20, 11, 0),
        "tstick": (11, 4, 3),
        "kitti": (28, 4, 0),
        "kitti_start": (25, 4, 0),
        "field": (16, 16, 0),
    }
    for domain, (trials, sessions, excluded) in counts.items():
        own = errors[domain]
        assert (len(own.trials), len(set(own.sessions)), own.excluded.sum()) == (trials, sessions, excluded)
        for method in METHODS:
            assert own.losses[method].shape == (SETTINGS, trials)
        assert np.isfinite(np.concatenate(list(own.losses.values()))).all()


TESTS, SATURATED = (2, 2, 3, 3, 4, 4, 4), 7
"""The test of each invented trial, and the trial that is saturated."""


def invented_rows(change=()):
    """Errors of all methods on seven trials of TStick and a saturated trial; ``change`` maps trials to a factor."""
    rng, rows = np.random.default_rng(5), []
    for number, test in enumerate((*TESTS, 5)):
        trial, factor = f"TStick_Test{test:02d}_Trial{number}", dict(change).get(number, 1.0)
        for method in METHODS:
            deg = factor * rng.lognormal(size=SETTINGS)
            rows += [("tstick", trial, method, setting, error) for setting, error in enumerate(deg)]
            rows.append(("tstick", trial, f"{method}, default", -1, factor * rng.lognormal()))
    return pd.DataFrame(rows, columns=["domain", "trial", "method", "setting", "inclination_rmse_deg"])


def domain_of(rows):
    fraction = pd.DataFrame(
        [("tstick", f"TStick_Test05_Trial{SATURATED}", 0.02)], columns=["domain", "trial", "fraction"]
    )
    return errors_of(rows, fraction)["tstick"]


def test_the_setting_has_the_lowest_median_on_the_trials_of_other_sessions_that_are_not_excluded():
    """The expected settings are computed from the rows with pandas."""
    rows = invented_rows()
    taken, own = settings_left_out(domain_of(rows), "mekf"), rows[rows["method"] == "mekf"]
    for number, test in enumerate((*TESTS, 5)):
        others = own[~own["trial"].str.contains(f"Test{test:02d}|Test05")]
        median = np.log(others.set_index("setting")["inclination_rmse_deg"]).groupby("setting").median()
        expected = [median[np.isin(median.index, subset)].idxmin() for subset in tried()]
        np.testing.assert_array_equal(taken[:, number], expected)


def test_an_excluded_trial_changes_neither_settings_nor_ratios():
    plain, changed = (domain_of(invented_rows(change)) for change in ({}, {SATURATED: 1e3}))
    np.testing.assert_array_equal(settings_left_out(plain, "mtf"), settings_left_out(changed, "mtf"))
    before, after = (losses_on(own) for own in (plain, changed))
    assert before["vqf"].shape == (TUNINGS, len(TESTS))
    assert verdicts_on(before, "constant") == verdicts_on(after, "constant")
    more = losses_on(changed, excluded=True)["vqf"] - losses_on(plain, excluded=True)["vqf"]
    np.testing.assert_allclose(more, np.full((TUNINGS, 1), np.log(1e3)))


@pytest.mark.parametrize("name", METHODS)
def test_a_setting_makes_its_plugin(name):
    """Each value of a setting changes the plugin."""
    method = METHODS[name]
    setting = dict(method.settings()[0])
    setting |= dict.fromkeys((*method.switches, "gravity"), 1.0)
    plugin = method.plugin(setting, 100.0)
    for key in setting:
        other = method.ranges[key].value(0.987) if key in method.ranges else 0.0
        assert method.plugin(setting | {key: other}, 100.0) != plugin, key
    assert method.plugin(setting, 100.0, "track").alignment == "track"


def test_holm_is_as_published_a_better_method_is_found_and_a_set_that_is_not_there_left_out(tmp_path):
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.9]) == [1.0, 1.0]
    n = np.random.default_rng(0).normal(size=(TUNINGS, 20))
    losses = {"constant": n, "vqf": n - 0.2, "mekf": n + 0.01 * n[::-1]}
    found = verdicts_on(losses, "constant")
    assert found["vqf"].median == pytest.approx((np.exp(-0.2),) * 3)
    assert (found["vqf"].wins, found["vqf"].n, found["vqf"].word) == (20, 20, "better")
    assert found["vqf"].p == pytest.approx(2 * 2 * 0.5**20)
    assert found["mekf"].word == "undecided"
    assert {trial.domain for trial in all_trials(tmp_path)} == {"field"}


@pytest.mark.parametrize("name", ["broad", "tstick", "kitti", "kitti_start", "field"])
def test_the_error_of_a_filter_is_that_of_the_stored_rows(shared_folder, name):
    stored = pd.read_parquet(page.HERE / page.ERRORS).set_index(["domain", "trial", "method", "setting"])
    trial = next(trial for trial in all_trials(shared_folder / "data") if trial.domain == name)
    known = trial.start_is_known
    plugin = METHODS["madgwick"].plugin(METHODS["madgwick"].settings()[5], 100.0, "track" if known else "")
    error = error_deg(plugin, trial.recordings(), 10.0 if known else 0.0)
    assert error == pytest.approx(stored.loc[(name, trial.name, "madgwick", 5), "inclination_rmse_deg"], rel=1e-5)
