"""Each library that is installed navigates as the plain loop does, run by run; one that is not is named."""

import pytest

from jerkbench.plugins import create

MODULES = {"simdkalman_runs": "simdkalman", "torch_kf_runs": "torch_kf"}
MODULES |= {"lgssm_filter_runs": "dynamax", "scan_runs": "dynamax"}
MAX_DIFFERENCE_M = {"simdkalman": 1e-12, "torch_kf": 1e-12, "dynamax": 1e-6}
"""dynamax adds 1e-9 to the diagonal of S before it solves; the eigenvalues of R are about 1e-4, innovations 0.1 m."""


@pytest.fixture
def timeline(script, monkeypatch):
    engines = script("engines")
    monkeypatch.setattr(engines, "STEPS", 200)
    return engines.workload()


@pytest.mark.filterwarnings("ignore:jax.*is deprecated:DeprecationWarning")  # by what dynamax depends on
@pytest.mark.parametrize("runs", [1, 3])
@pytest.mark.parametrize("way", MODULES)
def test_every_run_of_a_library_is_that_of_the_plain_loop(script, timeline, way, runs):
    pytest.importorskip(MODULES[way])
    peers, loop = script("peers"), script("plain_loops").filterpy_loop
    model = create("filter", {"name": "jerk"})

    position_m = getattr(peers, way)(timeline, model, runs)()

    assert position_m.shape == (runs, 201, 3)
    for shift in range(runs):
        x, _ = loop(peers.later(timeline, shift), model)
        assert abs(position_m[shift] - x[:, :3]).max() < MAX_DIFFERENCE_M[MODULES[way]]
        assert abs(position_m[shift] - position_m[shift - 1]).max() > 1e-3 or runs == 1


def test_a_library_that_is_not_installed_is_named_with_what_to_type(script, timeline, monkeypatch):
    peers = script("peers")
    absent = [peer._replace(module="surely_not_installed") for peer in peers.PEERS[:2]]
    monkeypatch.setattr(peers, "PEERS", absent)

    lines = peers.peer_lines(timeline, None, 1.0, 1)

    assert [str(line).split() for line in lines] == [
        ["simdkalman", "not", "installed:", "pip", "install", "simdkalman"],
        ["torch-kf", "not", "installed:", "pip", "install", "torch-kf"],
    ]
