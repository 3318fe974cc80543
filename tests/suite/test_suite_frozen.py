"""The frozen suite: its digests stand here a second time."""

import dataclasses
from itertools import islice

import pytest

from jerkbench.errors import PluginError, RecordingError
from jerkbench.presets import preset
from jerkbench.suite import protocol as protocols
from jerkbench.suite.campaign import half_settings
from jerkbench.suite.protocol import FROZEN, data_digests, read_suite, require_recordings

DIGESTS = {"v1": "1d88f1baae4c", "tiny": "c8613f7239bd"}


@pytest.mark.parametrize("scale", DIGESTS)
def test_the_protocols_are_those_that_were_frozen(scale):
    assert read_suite(scale).digest == FROZEN[scale].protocol == DIGESTS[scale]
    assert len(FROZEN[scale].data) == len(read_suite(scale).scenarios)


@pytest.mark.parametrize(("scale", "count"), [("tiny", 6), ("v1", 2)])
def test_the_simulated_data_are_those_that_were_frozen(scale, count):
    assert tuple(islice(data_digests(read_suite(scale)), count)) == FROZEN[scale].data[:count]


def test_a_changed_protocol_is_refused(monkeypatch):
    changed = {**preset("suite", "v1"), "trials": 33}
    monkeypatch.setattr(protocols, "preset", lambda *_: changed)

    with pytest.raises(PluginError, match="is not jerkbench-v1 any more"):
        read_suite("v1")


def test_other_data_are_refused():
    longer = dataclasses.replace(read_suite("tiny"), duration_s=41.0)

    with pytest.raises(RecordingError, match="The recordings of white, none are not those of jerkbench-tiny"):
        require_recordings("tiny", longer)


def test_the_seeds_to_test_on_are_none_that_are_tuned_on():
    for scale in DIGESTS:
        protocol = read_suite(scale)
        assert not set(protocol.seeds_to_tune_on) & set(protocol.seeds_to_test_on)
        assert len(protocol.seeds_to_test_on) == protocol.test_seeds


def test_nothing_is_scored_on_the_half_that_it_was_tuned_on():
    settings = {"given": (1.0,), "first": (2.0,), "second": (3.0,)}

    assert list(half_settings(settings, "first")) == ["given", "second"]
    assert list(half_settings(settings, "second")) == ["given", "first"]
    assert list(half_settings(settings, "both")) == ["given", "first", "second"]
