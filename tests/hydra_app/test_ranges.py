"""Ranges of a sweep have the values that were typed, and as many as a sweep can hold."""

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from hydra_plugins.jerkbench import JerkbenchSweeper
from jerkbench.errors import PluginError
from jerkbench.hydra_app import overrides


def jobs(*words):
    (batch,) = JerkbenchSweeper.split_arguments(OverridesParser.create().parse_overrides(list(words)), None)
    return [word for job in batch for word in job]


def test_decimal_ranges_add_decimals_and_end_before_their_stop():
    assert jobs("noise.accel_mps2=range(.1,.4,.1)") == [f"noise.accel_mps2={n}" for n in (0.1, 0.2, 0.3)]
    assert jobs("noise.accel_mps2=range(.1,.41,.1)")[-1] == "noise.accel_mps2=0.4"
    assert jobs("burn_in_s=range(1,-.2,-.5)") == [f"burn_in_s={n}" for n in (1.0, 0.5, 0.0)]


def test_whole_ranges_stay_whole():
    assert jobs("seeds=range(1,4)") == ["seeds=1", "seeds=2", "seeds=3"]


@pytest.mark.parametrize("word", ["seeds=range(3,3)", "seeds=range(1,3,0)", "burn_in_s=range(0,inf)"])
def test_a_range_without_values_or_end_is_refused(word):
    with pytest.raises(PluginError, match="range"):
        jobs(word)


@pytest.mark.parametrize("words", [["seeds=range(1,1000000000000)"], ["seeds=range(1,1002)", "burn_in_s=range(0,100)"]])
def test_more_combinations_than_can_be_held_are_refused_at_once(words):
    with pytest.raises(PluginError, match="combinations"):
        jobs(*words)


def test_a_key_that_is_given_twice_counts_once(monkeypatch):
    monkeypatch.setattr(overrides, "MAX_COMBINATIONS", 3)
    assert jobs("seeds=1,2", "seeds=3,4") == ["seeds=3", "seeds=4"]
