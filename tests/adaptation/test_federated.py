"""The federated filter against explicit local filters."""

import json

import numpy as np
import pytest

from jerkbench.contracts import empty_memory
from jerkbench.filters.kinematic import Jerk
from jerkbench.plugins import create

BLOCKS = (slice(0, 3), slice(3, 6))


def local_update(x, P, z, R, share, adaptive):
    """Information of one local filter, with the prior P / share and its factor on R."""
    prior = P / share
    S = prior[: len(z), : len(z)]
    energy, h, r = ((z - x[: len(z)]) ** 2).sum(), np.trace(S), np.trace(R)
    factor = (energy - h) / r if adaptive and energy >= h + r else 1.0
    information = np.linalg.inv(prior)
    vector = information @ x
    information[: len(z), : len(z)] += np.linalg.inv(factor * R)
    vector[: len(z)] += np.linalg.inv(factor * R) @ z
    return information, vector


def federated_update(x, P, z, R, beta, *, adaptive=True):
    """The fusion of the local filters of position and velocity."""
    velocity_first = np.r_[3:6, 0:3, 6 : len(x)]  # the block of the local filter comes first
    back = np.argsort(velocity_first)
    a, u = local_update(x, P, z[BLOCKS[0]], R[BLOCKS[0], BLOCKS[0]], beta, adaptive)
    shuffled = np.ix_(velocity_first, velocity_first)
    b, v = local_update(x[velocity_first], P[shuffled], z[BLOCKS[1]], R[BLOCKS[1], BLOCKS[1]], 1 - beta, adaptive)
    fused = np.linalg.inv(a + b[np.ix_(back, back)])
    return fused @ (u + v[back]), fused


def central_update(x, P, z, R, adaptation):
    """The update of the engine in textbook form."""
    n = len(x)
    innovation, HPHt = z - x[:6], P[:6, :6]
    adapted = adaptation.adapt(innovation, HPHt, R, np.arange(6), empty_memory(adaptation))
    K = P[:, :6] @ np.linalg.inv(HPHt + adapted)
    rest = np.eye(n) - K @ np.eye(6, n)
    return x + K @ innovation, rest @ P @ rest.T + K @ adapted @ K.T


def case(seed, scale):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(9, 30)) / np.sqrt(30)
    blocks = rng.normal(size=(2, 3, 12)) / np.sqrt(12)
    R = np.zeros((6, 6))
    for block, part in zip(BLOCKS, blocks, strict=True):
        R[block, block] = part @ part.T
    x = rng.normal(size=9)
    return x, half @ half.T, x[:6] + scale * rng.normal(size=6), R


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("beta", [0.1, 0.5, 0.8])
@pytest.mark.parametrize("scale", [0.1, 2.0, 30.0])
def test_explicit_local_filters_equal_the_central_filter_with_scaled_blocks(seed, beta, scale):
    x, P, z, R = case(seed, scale)
    federated = create("adaptation", {"name": "federated", "beta": beta})
    wanted_x, wanted_P = federated_update(x, P, z, R, beta)
    got_x, got_P = central_update(x, P, z, R, federated)

    np.testing.assert_allclose(got_x, wanted_x, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(got_P, wanted_P, rtol=1e-12, atol=1e-12)


def test_the_reference_values(shared_folder):
    golden = json.loads((shared_folder / "reference" / "golden.json").read_text())["federated_plain"]
    given, wanted = golden["inputs"], golden["outputs"]
    x, P = np.array(given["x0"]), np.array(given["P0"])
    A, b, Q = Jerk(given["sigma_a"], given["sigma_jerk"]).axis_model(given["dt"], given["dt"])
    F, B, Q = (np.kron(part, np.eye(3)) for part in (A, b[:, None], Q))
    for u in np.array(given["u"]):
        x, P = F @ x + B @ u, F @ P @ F.T + Q
    R, z = np.diag(given["R_diag"]), np.array(given["z"])
    federated = create("adaptation", {"name": "federated", "beta": given["beta"][0]})
    locals_x, locals_P = federated_update(x, P, z, R, given["beta"][0], adaptive=given["adaptive"])

    for got_x, got_P in [central_update(x, P, z, R, federated), (locals_x, locals_P)]:
        np.testing.assert_allclose(got_x, wanted["x"], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(np.diag(got_P), wanted["P_diag"], rtol=1e-8, atol=1e-8)
