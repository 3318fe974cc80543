import pickle

import pytest

from jerkbench import plugins

NAMES = ("none", "gnss_outage", "multipath_single_axis", "bias", "decimate_position", "withhold")


@pytest.mark.parametrize("name", NAMES)
def test_the_input_stays_and_the_same_seed_gives_the_same(recording, name):
    disturbance = plugins.create("disturbance", {"name": name})
    before = pickle.dumps(recording)
    first, again = disturbance.apply(recording, 3), disturbance.apply(recording, 3)
    assert pickle.dumps(recording) == before
    assert pickle.dumps(first) == pickle.dumps(again)
    assert (pickle.dumps(disturbance.apply(recording, 4)) != pickle.dumps(first)) == (
        disturbance.seeded or disturbance.replicates() > 1
    )


@pytest.mark.parametrize("name", NAMES)
def test_seeds_beyond_the_replicates_repeat(recording, name):
    disturbance = plugins.create("disturbance", {"name": name})
    n = disturbance.replicates()
    if not disturbance.seeded:
        results = [pickle.dumps(disturbance.apply(recording, seed)) for seed in range(2 * n)]
        assert len(set(results)) == n
        assert results[:n] == results[n:]


def test_none_is_the_identity(recording):
    assert plugins.create("disturbance", {"name": "none"}).apply(recording, 0) is recording
