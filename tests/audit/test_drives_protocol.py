"""The second protocol of the audit: what it states has to be there, and be so."""

import pytest

from commands import verb
from jerkbench import plugins
from jerkbench.evaluation.statistics import drives_and_tunings
from jerkbench.parameters import provenance_of
from jerkbench.plugins import create
from jerkbench.presets import preset


@pytest.fixture(scope="module")
def stated():
    return preset("audit", "drives")


def test_it_lists_every_adaptation_with_what_it_is(stated):
    apart = {stated["plain"], *stated["references"]}
    ours = {name for name in plugins.names("adaptation") if plugins.is_own(plugins.get("adaptation", name))}

    kinds = {name: provenance_of(plugins.get("adaptation", name)).kind for name in ours - apart}
    assert stated["adaptations"] == kinds


def test_the_plain_filters_may_try_as_many_settings_as_the_methods_that_are_picked_from(stated):
    picked = [name for name, kind in stated["adaptations"].items() if kind != "own"]

    filters = len(stated["filters"])
    assert filters * stated["plain_trials"] == len(picked) * filters * stated["trials"] == 2112


def test_its_drives_and_filters_are_there(stated):
    assert create("dataset", preset("dataset", stated["dataset"])).fault_shares == (0.2, 0.4, 0.25, 0.15)
    for name in (*stated["filters"], *stated["apart"], *stated["apart_with_adaptations"]):
        assert plugins.get("filter", name)
    assert (stated["margin"], stated["resampled_audits"]) == (drives_and_tunings.MARGIN, drives_and_tunings.AUDITS)


def test_the_command_of_the_first_protocol_refuses_it_in_a_sentence(tmp_path):
    done = verb("audit", "--scale", "drives", cwd=tmp_path)

    assert done.returncode == 2
    assert "conf/audit/drives.yaml" in done.stderr
