"""Single steps against reference values that were made by an independent implementation."""

import json

import numpy as np
import pytest

from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.plugins import create
from jerkbench.timeline import Measurements, Timeline

CASES = ["base_none", "jerk_none", "jerk_mtf_single_axis", "jerk_scalar_r", "jerk_sage_husa_3_updates"]
FILTERS = {"base": "baseline", "jerk": "jerk"}
EXACT = {"rtol": 1e-10, "atol": 1e-10}


@pytest.fixture(scope="module")
def golden(shared_folder):
    return json.loads((shared_folder / "reference" / "golden.json").read_text())


def build_model(given):
    name = FILTERS[given["kind"]]
    parameters = {"name": name, "accel_mps2": given["sigma_a"]}
    if name == "jerk":
        parameters["jerk_mps3_per_sqrt_s"] = given["sigma_jerk"]
    return create("filter", parameters)


def build_timeline(given, measured):
    """Five predict steps before each update, a stamp of the reference before it and after it."""
    updates = len(measured)
    steps = 5 * updates
    ends = np.arange(4, steps, 5)
    update, reference = np.full(steps, -1), np.full(steps, -1)
    update[ends], reference[ends] = np.arange(updates), np.arange(updates)
    R = np.tile(np.diag(given["R_diag"]), (updates, 1, 1))
    t_ns = (np.arange(updates) + 1) * 50_000_000
    return Timeline(
        dt0_s=given["dt"],
        dt_s=np.full(steps, given["dt"]),
        sample=np.tile(np.arange(5), updates),
        update=update,
        reference=reference,
        accel_enu_mps2=np.array(given["u"], dtype=float),
        measurements=Measurements(t_ns, np.array(measured, dtype=float), R, R),
        x0=np.zeros(6),
        P0=np.eye(6),
        euler_rad=np.zeros((updates, 3)),
        t_s=np.arange(steps) * given["dt"],
    )


@pytest.mark.parametrize("case", CASES)
def test_filter_and_adaptation_agree_with_the_reference_values(golden, case, monkeypatch):
    given, wanted = golden[case]["inputs"], golden[case]["outputs"]
    model = build_model(given)
    adaptation = create("adaptation", {"name": given["mode"]})
    timeline = build_timeline(given, [step["z"] for step in wanted])
    start_from(monkeypatch, given)
    estimate = FilterpyEngine().run(timeline, model, adaptation)

    assert estimate.failure == ""
    for k, step in enumerate(wanted):
        np.testing.assert_allclose(estimate.position_m[k], step["x"][:3], **EXACT)
        np.testing.assert_allclose(estimate.velocity_mps[k], step["x"][3:6], **EXACT)
        np.testing.assert_allclose(np.diag(estimate.covariance[k]), step["P_diag"][:6], **EXACT)
        np.testing.assert_allclose(estimate.covariance[k, 0], step["P_first_row"][:6], **EXACT)
        np.testing.assert_allclose(estimate.updates.innovation[k], step["innovation"], **EXACT)
        np.testing.assert_allclose(estimate.updates.R_diagonal[k], step["R_used"], **EXACT)
        # The reference forms its NIS from the S that was used.
        np.testing.assert_allclose(estimate.updates.nis_used[k], step["nis"], rtol=1e-10)


def start_from(monkeypatch, given):
    """Let the engine start from the full state and covariance of the reference case."""
    from jerkbench.engines import filterpy_engine

    original = filterpy_engine._new_filter

    def start(timeline, model):
        kf = original(timeline, model)
        n = kf.dim_x
        kf.x, kf.P = np.array(given["x0"][:n])[:, None], np.array(given["P0"])[:n, :n]
        return kf

    monkeypatch.setattr(filterpy_engine, "_new_filter", start)
