"""Shapley's shares where they are known, and an attribution of seconds."""

import dataclasses
import json
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from jerkbench.audit.methods import AuditMethod

import jerkbench
from experiment_scripts import experiment
from jerkbench.audit.page import sections_in
from jerkbench.jobs.cluster import Local

attribution = experiment("attribution/attribution.py")
games = experiment("attribution/shapley.py")
FACTORS, Q, R, WHOLE, corners, shapley = games.FACTORS, games.Q, games.R, games.WHOLE, games.corners, games.shapley
naive, naive_space, subset_settings = attribution.naive, attribution.naive_space, attribution.subset_settings
run_attribution, family_table, shares = attribution.run_attribution, games.family_table, games.shares

PARTS = {"a": -1.0, "b": 0.5, "c": -0.25}


def test_the_shares_of_a_sum_are_its_parts():
    values = {corner: np.array([[sum(PARTS[name] for name in corner)]]) for corner in corners("abc")}
    assert {name: float(part[0, 0]) for name, part in shapley(values, "abc").items()} == pytest.approx(PARTS)


def test_what_two_do_only_together_is_shared_between_them():
    """The glove game: a left glove (a) and two right ones (b, c) make one pair; 2/3, 1/6, 1/6 in the textbooks."""
    values = {corner: np.array(float("a" in corner and len(corner) > 1)) for corner in corners("abc")}
    assert {k: float(v) for k, v in shapley(values, "abc").items()} == pytest.approx(
        {"a": 2 / 3, "b": 1 / 6, "c": 1 / 6}
    )


def test_the_shares_add_up_to_the_whole_whatever_the_values():
    rng = np.random.default_rng(2)
    values = {corner: rng.normal(size=(5, 4)) for corner in corners(FACTORS)}
    rows = shares(values, ["x", "y", "y", "z", "z"])
    *factors, whole = rows
    assert whole.factor == WHOLE
    assert np.prod([row.ratio.ratio for row in factors]) == pytest.approx(whole.ratio.ratio, rel=1e-12)
    assert sum(row.share for row in factors) == pytest.approx(1.0)


def test_families_count_alike_and_have_their_interval():
    """In x the factor `model` halves the error, in y and its four scenarios it does nothing: the mean is 1/sqrt(2)."""
    gain = np.repeat([[np.log(0.5)], [0.0], [0.0], [0.0], [0.0]], 3, axis=1)
    values = {corner: gain * ("model" in corner) for corner in corners(FACTORS)}
    model = next(row for row in shares(values, ["x", "y", "y", "y", "y"]) if row.factor == "model")
    assert model.ratio.ratio == pytest.approx(np.sqrt(0.5))
    assert model.alone == model.last == pytest.approx(np.sqrt(0.5))
    assert model.ratio.low < 0.5
    assert model.ratio.high > 1.0


def test_the_table_by_family_has_the_ratios_that_were_put_in():
    gain = np.log([[0.5, 0.5], [3.0, 3.0]])
    corner_values = {corner: gain * ("attitude" in corner) for corner in corners(FACTORS)}
    lines = family_table(corner_values, ["x", "y"]).splitlines()
    assert lines[2:] == ["| x | 1.00 | 1.00 | 1.00 | 1.00 | 0.50 |", "| y | 1.00 | 1.00 | 1.00 | 1.00 | 3.00 |"]


@pytest.fixture(scope="module")
def protocol():
    whole = attribution.attribution_protocol()
    families = tuple(
        dataclasses.replace(family, severities=dict(list(family.severities.items())[-1:]))
        for family in whole.families
        if family.name in ("none", "outliers", "wheel_slip")
    )
    return dataclasses.replace(
        whole, duration_s=20.0, fields={"white": "field_white"}, families=families, trials=3, tune_seeds=1, test_seeds=2
    )


def test_the_protocol_is_that_of_the_committed_shares():
    stored = json.loads((Path(__file__).parents[2] / "results/audit-attribution/protocol.json").read_text())
    assert attribution.attribution_protocol().digest == stored["digest"]


def test_an_audit_takes_the_section_and_the_figure_along(tmp_path):
    committed, audit = Path(__file__).parents[2] / "results/audit-attribution", tmp_path / "audit-full"
    attribution.take_along(committed, audit)

    assert sections_in(audit) == (committed / "README.md").read_text()
    assert (audit / "waterfall.png").read_bytes() == (committed / "waterfall.png").read_bytes()


def test_only_the_knobs_that_are_tuned_differ_from_the_naive_ones(protocol):
    scenario = protocol.scenarios[0]
    space = naive_space(AuditMethod("jerk", "mtf").space(scenario), naive())
    assert dict(zip(space.names, space.start, strict=True))["filter.accel_mps2"] == 0.02  # conf/noise/naive.yaml
    for subset, parts in (({Q}, {"filter"}), ({R}, {"r_scale", "adaptation"}), (set(), set())):
        settings = np.array(subset_settings(space, frozenset(subset), 8))
        varied = {space.knobs[k].part for k in np.flatnonzero(np.ptp(settings, axis=0))}
        assert varied == parts
        assert len(settings) == (8 if subset else 1)


def require_shares(folder):
    """Require that the shares, and the page, are those of the corners."""
    table = pd.read_csv(folder / "corners.csv")
    means = table.groupby(list(FACTORS))["log_rmse"].mean()
    values = {
        frozenset(name for name, on in zip(FACTORS, flags, strict=True) if on): np.array(means[flags])
        for flags in product((False, True), repeat=5)
    }
    again = shapley(values, FACTORS)
    stored, page = pd.read_csv(folder / "shares.csv").set_index("factor"), (folder / "README.md").read_text()
    for name in FACTORS:
        assert stored.loc[name, "ratio"] == pytest.approx(np.exp(again[name]), rel=1e-9)
        assert f"| {name} | {np.exp(again[name]):.2f} [" in page
    assert stored.loc[list(FACTORS), "ratio"].prod() == pytest.approx(stored.loc[WHOLE, "ratio"])
    assert (folder / "waterfall.png").stat().st_size > 5000
    return table


def test_the_committed_attribution_is_what_its_corners_say():
    assert len(require_shares(Path(__file__).parents[2] / "results/audit-attribution")) == 2**5 * 14


def test_an_attribution_is_what_its_rows_say(protocol, tmp_path):
    found = run_attribution(protocol, tmp_path, Local(), workers=1)

    assert len(require_shares(tmp_path)) == 2**5 * 3
    assert f"{found.shares[-1].ratio.ratio:.3f}" in (tmp_path / "README.md").read_text()


def test_untuned_corners_are_runs_of_the_naive_filters_with_the_gyros_attitude(protocol, tmp_path):
    untuned = dataclasses.replace(protocol, trials=1)
    found = run_attribution(untuned, tmp_path, Local(), workers=1)
    for corner, values in found.corners.items():
        np.testing.assert_allclose(values, found.corners[corner - {Q, R}])

    errors = {
        model: jerkbench.run(
            dataset={"name": "field_white", "duration_s": 20.0},
            attitude="gyro_only",
            filter={"name": model, "accel_mps2": 0.02},
            seeds=2,
            first_seed=untuned.seeds_to_test_on[0],
        )["position_rmse_m"].to_numpy()
        for model in ("baseline", "jerk")
    }
    none = found.families.index("none")
    jerk, baseline = (found.corners[frozenset(on)][none] for on in (("model",), ()))
    np.testing.assert_allclose(jerk - baseline, np.log(errors["jerk"] / errors["baseline"]), rtol=1e-9)
