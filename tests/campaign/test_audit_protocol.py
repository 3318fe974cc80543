"""The protocols of the audit, and arguments of `jerkbench audit` that are refused."""

import dataclasses
import json

import pytest

from commands import verb
from jerkbench import plugins
from jerkbench.campaign.protocol import PUBLISHED, audit_protocol, read_protocol
from jerkbench.errors import PluginError
from jerkbench.parameters import provenance_of
from jerkbench.presets import preset, preset_files

SCALES = list(preset_files("audit"))


@pytest.fixture(scope="module")
def full():
    return read_protocol("full")


def test_it_lists_every_adaptation_with_what_it_is_and_its_digest_the_laws_of_the_drives(full):
    apart = {full.plain, *full.references}
    ours = {name for name in plugins.names("adaptation") if plugins.is_builtin(plugins.get("adaptation", name))}
    assert full.adaptations == {name: provenance_of(plugins.get("adaptation", name)).kind for name in ours - apart}
    assert len(full.methods) == 4 * 27
    assert full.laws == preset("dataset", "mixture")
    milder = {**full.laws, "fault_shares": [0.95, 0.05]}
    assert dataclasses.replace(full, laws=milder).digest != full.digest


@pytest.mark.parametrize("scale", SCALES)
def test_the_plain_filters_may_try_as_many_settings_as_the_methods_that_are_picked_from(scale):
    protocol = read_protocol(scale)
    picked = [name for name in protocol.compared if protocol.adaptations[name] in PUBLISHED]

    assert len(protocol.plains) * protocol.plain_trials == len(picked) * len(protocol.filters) * protocol.trials


def test_no_drive_is_used_twice_in_one_or_in_two_protocols():
    seeds = [
        seed
        for protocol in map(read_protocol, SCALES)
        for r in range(protocol.tunings + 1)
        for seed in (protocol.seeds_to_tune_on(r) if r < protocol.tunings else protocol.seeds_to_judge_on)
    ]

    assert len(set(seeds)) == len(seeds)


@pytest.mark.parametrize(
    ("more", "less", "message"),
    [({"trails": 3}, (), "has the unknown key trails"), ({}, ("trials",), "does not have the key trials")],
    ids=["unknown", "missing"],
)
def test_a_parameter_that_is_wrong_is_named(more, less, message):
    stated = {k: v for k, v in preset("audit", "small").items() if k not in less} | more | {"laws": {}}

    with pytest.raises(PluginError, match=f"mine.yaml {message}"):
        audit_protocol(stated, "mine.yaml")


@pytest.mark.parametrize(("field", "given", "least"), [("judged_drives", 48, 64), ("tunings", 2, 3)])
def test_too_few_drives_or_tunings_are_refused_before_anything_runs(field, given, least):
    with pytest.raises(PluginError, match=f"{field} is {given}; give {least} or more"):
        dataclasses.replace(read_protocol("small"), **{field: given})


def test_nothing_stored_is_refused_in_a_sentence(tmp_path):
    done = verb("audit", "--stored", "--scale", "small", cwd=tmp_path)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "results/audit-small" in done.stderr
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("words", [[], ["--stored"]], ids=" ".join)
def test_an_empty_scale_is_refused_and_starts_nothing(tmp_path, monkeypatch, words):
    monkeypatch.setattr("jerkbench.campaign.audit.run_audit", lambda *_, **__: pytest.fail("an audit"))

    done = verb("audit", "--scale", "", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert "There is no preset of audit ''" in done.stderr


def test_the_results_of_another_protocol_are_not_mixed_with_these(tmp_path):
    folder = tmp_path / "results" / "audit-small"
    folder.mkdir(parents=True)
    (folder / "protocol.json").write_text(json.dumps({"digest": "817ceac5945c"}), encoding="utf-8")

    done = verb("audit", "--scale", "small", cwd=tmp_path)

    assert done.returncode == 2
    assert "another protocol: its digest is 817ceac5945c" in done.stderr
    assert not (folder / "runs").exists()
