"""Both engines over gaps of 100 s, against sixty decimal digits, and where they refuse."""

from dataclasses import replace

import numpy as np
import pytest
from exact_filter import ExactRun

from jerkbench import plugins
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.filters.kinematic import Jerk
from jerkbench.timeline import Measurements, Timeline

ENGINES = [FilterpyEngine(), CompiledEngine()]
GAP_S = 100.0


def timeline_with_a_gap(position_sigma_m, velocity=True, gap_s=GAP_S, seed=0):
    """Four fixes, nothing for ``gap_s``, not even the IMU, and four fixes."""
    rng = np.random.default_rng(seed)
    dt_s = np.full(33, 0.1)
    dt_s[[0, 17]] = 0.0, gap_s
    update, reference = np.full(33, -1), np.arange(33)
    update[4::4] = np.arange(8)
    R = np.diag([position_sigma_m**2] * 3 + [0.05**2] * 3)
    z = np.hstack(
        [rng.normal(0.0, 0.01, (8, 3)), rng.normal(0.0, 0.05, (8, 3)) if velocity else np.full((8, 3), np.nan)]
    )
    P0 = np.diag([0.01**2] * 3 + [0.1**2] * 3)
    t_s = np.cumsum(dt_s)
    measured = Measurements(np.round(t_s[4::4] * 1e9).astype(np.int64), z, np.tile(R, (8, 1, 1)), np.tile(R, (8, 1, 1)))
    u = rng.normal(0.0, 0.2, (32, 3))
    sample = np.maximum(np.arange(33) - 1, 0)
    return Timeline(0.1, dt_s, sample, update, reference, u, measured, np.zeros(6), P0, np.zeros((33, 3)), t_s)


@pytest.mark.parametrize("adaptation", ["none", "sage_husa", "scalar_q", "mtf"])
@pytest.mark.parametrize("model", ["jerk", "acceleration"])
@pytest.mark.parametrize("velocity", [True, False], ids=["with velocity", "position alone"])
@pytest.mark.parametrize("position_sigma_m", [0.01, 1e-3])
def test_after_a_gap_the_engines_are_right_to_a_thousandth_of_a_sigma(position_sigma_m, velocity, model, adaptation):
    """filterpy's inverse of S was off by 5 to 500 sigma, and the compiled P by 3 % without velocity."""
    timeline = timeline_with_a_gap(position_sigma_m, velocity)
    pair = plugins.create("filter", {"name": model}), plugins.create("adaptation", {"name": adaptation})
    x, P = ExactRun(timeline, *pair).states()
    sigma = np.sqrt(np.einsum("nii->ni", P))
    for engine in ENGINES:
        run = engine.run(timeline, *pair)
        assert run.failure == ""
        assert (np.abs(np.hstack([run.position_m, run.velocity_mps]) - x) < 1e-3 * sigma).all(), engine
        assert (np.abs(run.covariance - P) < 1e-2 * sigma[:, :, None] * sigma[:, None, :]).all(), engine


@pytest.mark.parametrize("model", ["jerk", "acceleration"])
def test_up_to_the_limit_both_engines_are_right_and_there_both_refuse(model):
    """At the very limit rounding widens a variance by a thousandth; x may be off by a twentieth of its sigma."""
    pair = plugins.create("filter", {"name": model}), plugins.create("adaptation", {"name": "none"})
    ended = []
    for gap_s in (100.0, 150.0, 200.0, 300.0, 450.0, 700.0, 1000.0, 2000.0, 5000.0, 20_000.0):
        timeline = timeline_with_a_gap(1e-3, gap_s=gap_s)
        runs = [engine.run(timeline, *pair) for engine in ENGINES]
        assert runs[0].failure == runs[1].failure
        ended.append(bool(runs[0].failure))
        x, P = ExactRun(timeline, *pair).states()
        sigma = np.sqrt(np.einsum("nii->ni", P))
        for run in runs:
            n = len(run.index)
            scaled = np.abs(run.covariance - P[:n]) / (sigma[:n, :, None] * sigma[:n, None, :])
            assert (np.abs(np.hstack([run.position_m, run.velocity_mps]) - x[:n]) < 0.05 * sigma[:n]).all(), gap_s
            assert (scaled < 1e-2).all(), gap_s
    assert ended == sorted(ended)
    assert not ended[0]
    assert "no longer positive definite" in runs[0].failure


@pytest.mark.parametrize("engine", ENGINES, ids=["filterpy", "compiled"])
def test_a_reported_covariance_that_is_not_symmetric_ends_the_run(engine):
    timeline = timeline_with_a_gap(0.01)
    R = timeline.measurements.R.copy()
    R[3, 0, 1] += 1e-5
    lopsided = replace(timeline, measurements=replace(timeline.measurements, R=R))
    run = engine.run(lopsided, Jerk(), plugins.create("adaptation", {"name": "none"}))

    assert "no longer positive definite at 1.60 s" in run.failure
    assert np.isnan([run.updates.nis[-1], run.updates.nis_used[-1]]).all()
    assert np.isfinite(run.updates.nis[:-1]).all()
