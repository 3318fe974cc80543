"""The tilt competition: leaving out, the test's correction, equal tuning, and the page against the kept rows."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiment_scripts import EXPERIMENTS, experiment

page = experiment("attitude/page.py")
methods = experiment("attitude/methods.py")
run = experiment("attitude/run.py")

README = EXPERIMENTS / "attitude" / "README.md"


@pytest.fixture(scope="module")
def errors():
    return page.errors_of(pd.read_parquet(run.KEPT))


def test_the_tables_of_the_page_are_those_of_the_rows(errors):
    text = README.read_text(encoding="utf-8")
    assert page.filled(text, errors) == text


def test_every_method_has_every_setting_on_every_trial(errors):
    for domain, trials in (("broad", 20), ("tstick", 11), ("kitti", 28)):
        for method in methods.METHODS:
            assert errors[domain][method].shape == (methods.SETTINGS, trials)
        assert np.isfinite(np.concatenate(list(errors[domain].values()))).all()


def test_a_trial_does_not_choose_its_own_setting():
    """Setting 0 is the best on every trial but the last, where it is far worse: there it is taken all the same."""
    loss = np.ones((methods.SETTINGS, 5))
    for subset in page.tried():
        loss[subset[0], :4], loss[subset[0], 4] = 0.0, 9.0
    taken = page.chosen(loss)
    for r, subset in enumerate(page.tried()):
        assert taken[r, 4] in subset
        assert loss[taken[r, 4], 4] == 9.0
        assert loss[taken[r, 0], 4] == 1.0
    np.testing.assert_array_equal(page.scored(loss, taken)[:, 4], 9.0)


def test_every_method_is_tuned_with_the_same_numbers():
    assert {len(method.settings()) for method in methods.METHODS.values()} == {methods.SETTINGS}
    assert {len(subset) for subset in page.tried()} == {page.EACH}
    assert len(page.tried()) == page.TUNINGS
    for method in methods.METHODS.values():
        for switch in method.switches:
            assert sum(setting[switch] for setting in method.settings()) == methods.SETTINGS / 2
        for name, bounds in method.ranges.items():
            shares = np.array([bounds.share(setting[name]) for setting in method.settings()])
            assert np.ptp(shares) > 0.9


@pytest.mark.parametrize("name", methods.METHODS)
def test_a_setting_makes_its_plugin(name):
    """Each value of a setting changes the plugin."""
    method = methods.METHODS[name]
    setting = dict(method.settings()[0])
    setting |= dict.fromkeys(method.switches, 1.0)
    plugin = method.make(setting, 100.0)
    for key in setting:
        other = 0.0 if key in method.switches else method.ranges[key].value(0.987)
        assert method.make(setting | {key: other}, 100.0) != plugin, key


def test_holm_is_what_the_paper_says():
    np.testing.assert_allclose(page.holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert page.holm([0.6, 0.9]) == [1.0, 1.0]


def test_a_method_that_is_always_better_is_found():
    n = np.random.default_rng(0).normal(size=(page.TUNINGS, 20))
    losses = {"constant": n, "vqf": n - 0.2, "mekf": n + 0.01 * n[::-1]}
    found = page.verdicts(losses, "constant")
    assert found["vqf"][0].startswith("0.82 ")
    assert found["vqf"][2:] == ["20/20", "3.8e-06", "better"]
    assert found["mekf"][-1] == "undecided"


def test_a_piece_ends_where_samples_are_missing(tmp_path):
    trials = experiment("attitude/trials.py")
    t = np.concatenate([np.arange(0, 8, 0.01), np.arange(9, 12, 0.01), np.arange(13, 20, 0.01)])
    names = ["ax", "ay", "az", "gx", "gy", "gz", "e", "n", "u", "ve", "vn", "vu", "roll", "pitch", "yaw"]
    drive = pd.DataFrame(0.0, index=range(len(t)), columns=names).assign(t=t, az=9.81)
    drive.loc[t > 3.0, "ve"] = 5.0
    drive.to_parquet(tmp_path / "a_drive.parquet")
    (trial,) = trials.kitti(Path(tmp_path))
    assert [len(piece[1]) for piece in trial.pieces] == [800, 700]
    assert [piece[0].static_start_s for piece in trial.pieces] == [pytest.approx(3.01), 0.0]
    assert run.error_deg(methods.METHODS["mekf"].default, trial) < 1e-6
