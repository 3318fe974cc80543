"""The page on attitude filters against the kept rows."""

import numpy as np
import pandas as pd
import pytest

from experiment_scripts import EXPERIMENTS, experiment
from jerkbench.audit.tilt_study import errors_of
from jerkbench.audit.tilt_trials import TILT_METHODS, TILT_SETTINGS

page = experiment("attitude/page.py")


@pytest.fixture(scope="module")
def errors():
    return errors_of(pd.read_parquet(page.HERE / page.KEPT))


def test_the_tables_of_the_page_are_those_of_the_rows(errors):
    text = (EXPERIMENTS / "attitude" / "README.md").read_text(encoding="utf-8")
    assert page.filled(text, errors) == text


def test_every_method_has_every_setting_on_every_trial(errors):
    for domain, trials in (("broad", 20), ("tstick", 11), ("kitti", 28), ("kitti_start", 25), ("field", 16)):
        for method in TILT_METHODS:
            assert errors[domain][method].shape == (TILT_SETTINGS, trials)
        assert np.isfinite(np.concatenate(list(errors[domain].values()))).all()
