"""A worker refuses what was planned with other code, other versions or other plugins."""

import socket
from dataclasses import replace

import pytest

from jerkbench.jobs.cluster import ClusterError
from jerkbench.jobs.dispatch import Foreign, Parcel, identity_of, run_packed, worker_refusal
from jerkbench.jobs.job import Protocol, build

SPEC = {
    "dataset": {"name": "field"},
    "disturbance": [{"name": "none"}],
    "attitude": {"name": "tilt"},
    "filter": {"name": "jerk"},
    "adaptation": {"name": "none"},
    "engine": {"name": "compiled"},
}


@pytest.fixture
def identity():
    return identity_of([build(SPEC, Protocol())])


def test_the_process_that_planned_may_run_its_plan(identity):
    assert identity.plugins == ()
    assert worker_refusal(identity) == ""


def test_other_versions_are_named_with_both(identity):
    other = tuple((name, "1.2.3" if name == "numpy" else version) for name, version in identity.versions)
    sentence = worker_refusal(replace(identity, versions=other))

    assert f"The worker on {socket.gethostname()} has numpy {dict(identity.versions)['numpy']} for 1.2.3;" in sentence


def test_other_code_is_refused(identity):
    assert "has other code of jerkbench" in worker_refusal(replace(identity, code="0" * 64))


def test_a_plugin_that_the_worker_does_not_have_is_named(identity):
    missing = Foreign("filter doubting", "doubting_elsewhere", "Doubting", "")
    sentence = worker_refusal(replace(identity, plugins=(missing,)))

    assert "lacks the filter doubting (doubting_elsewhere): ModuleNotFoundError" in sentence
    assert "Install its package there" in sentence


def test_another_version_of_a_plugin_is_refused(identity):
    other = Foreign("filter jerk", "jerkbench.filters.kinematic", "Jerk", "another")

    assert "another version of the filter jerk" in worker_refusal(replace(identity, plugins=(other,)))


def test_nothing_of_a_plan_is_read_before_the_identity_is_known(identity):
    with pytest.raises(ClusterError, match="other code"):
        run_packed(Parcel(replace(identity, code=""), "", b"no pickle"))
