"""The tilt filter: reference values, its equations one by one, and what they promise."""

import itertools
import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tilt_oracle import G, tilt_samples

from jerkbench.attitude import tilt_filter
from jerkbench.attitude.alignment import TiltStart
from jerkbench.attitude.common import roll_pitch
from jerkbench.attitude.tilt_filter import TiltParameters, run_tilt, settings_of
from jerkbench.attitude.tilt_kernel import ADAPTATIONS, make_room, run_samples

LEVEL = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def golden(shared_folder):
    return json.loads((shared_folder / "reference" / "golden.json").read_text())


def after(samples, p, x=LEVEL, P=None, a_prev=(0.0, 0.0, 0.0), loop=run_samples):
    """What the loop leaves behind ``samples`` (gyro, accel, dt): its room, and the flags."""
    n = len(samples[2])
    room, flags = make_room(np.array(x), 0.03, p.window), np.empty(n, dtype=bool)
    room.P[:] = 0.03 * np.eye(3) if P is None else P
    room.a_prev[:] = a_prev
    loop(room, *samples, settings_of(p), np.empty((n, 3)), flags)
    return room, flags


@pytest.mark.parametrize("loop", [lambda: run_samples, tilt_filter._compiled], ids=["uncompiled", "compiled"])
@pytest.mark.parametrize("name", ["tilt_mtf_triggered", "tilt_none"])
def test_one_step_equals_the_reference_values(name, loop, golden):
    given, wanted = golden[name]["inputs"], golden[name]["outputs"]
    p = TiltParameters(
        given["sigma_G"], given["sigma_A"], given["c_a"], normalise=given["normalise"], adapt=given["adapt"]
    )
    samples = np.array([given["y_G"]]), np.array([given["y_A"]]), np.array([given["dt"]])
    room, (triggered,) = after(samples, p, given["x"], given["P"], given["a_prev"], loop())
    roll, pitch = roll_pitch(room.x)
    got = {
        "innovation": room.e,
        "sigma_acc": room.noise - p.sigma_accel_mps2**2,
        "x": room.x,
        "P": room.P,
        "a_ext": room.a_prev,
        "roll": roll,
        "pitch": pitch,
        "P_prior": (np.diag(wanted["P_prior"]), (room.C0 - p.sigma_accel_mps2**2) / G**2),
    }
    assert triggered == wanted["triggered"]
    assert got.keys() == wanted.keys() - {"triggered", "x_prior"}  # e and x tell of x-
    prior = got.pop("P_prior")
    np.testing.assert_allclose(*prior, rtol=0, atol=1e-10)
    for key, value in got.items():
        np.testing.assert_allclose(value, wanted[key], rtol=0, atol=1e-10, err_msg=key)


@pytest.mark.parametrize("name", ["tilt_mtf_triggered", "tilt_none"])
def test_the_oracle_has_the_reference_values_too(name, golden):
    given, wanted = golden[name]["inputs"], golden[name]["outputs"]
    p = TiltParameters(
        given["sigma_G"], given["sigma_A"], given["c_a"], normalise=given["normalise"], adapt=given["adapt"]
    )
    state = np.array(given["x"]), np.array(given["P"])
    samples = np.array([given["y_G"]]), np.array([given["y_A"]]), given["dt"]
    (sample,) = tilt_samples(*state, *samples, p, given["a_prev"])

    for key, value in sample._asdict().items():
        np.testing.assert_allclose(value, wanted[key], rtol=0, atol=1e-10, err_msg=key)


def shaken(n, seed=0):
    """A turning, shaken IMU with uneven intervals: quiet at first, so that it triggers now and then only."""
    rng = np.random.default_rng(seed)
    gyro = 0.3 * rng.normal(size=(n, 3))
    gyro[7] = 0.0
    accel = G * LEVEL + 0.02 * rng.normal(size=(n, 3))
    accel[n // 3 :] += rng.normal(size=3) * (rng.random((n - n // 3, 1)) < 0.4)
    return gyro, accel, rng.uniform(0.005, 0.02, n)


@pytest.mark.parametrize("adapt", ADAPTATIONS)
@pytest.mark.parametrize("exact", [False, True])
def test_a_run_equals_the_equations_one_by_one(adapt, exact):
    samples = shaken(80)
    for window, memory, normalise in itertools.product((1, 4), (0.0, 0.6), (True, False)):
        p = TiltParameters(0.05, 0.3, memory, window, normalise, exact, adapt)
        x, triggered = run_tilt(TiltStart(LEVEL, 0.03), *samples, p)
        wanted = tilt_samples(LEVEL, 0.03 * np.eye(3), *samples, p)
        np.testing.assert_allclose(x, [sample.x for sample in wanted], rtol=0, atol=1e-11)
        np.testing.assert_array_equal(triggered, [sample.triggered for sample in wanted])
        assert 0 < triggered.sum() < 80


@pytest.mark.parametrize("adapt", ADAPTATIONS)
def test_without_a_compiler_the_same_loop_runs(adapt, monkeypatch):
    samples, p = shaken(200), TiltParameters(0.05, 0.3, 0.6, 4, exact=True, adapt=adapt)
    x, triggered = run_tilt(TiltStart(LEVEL, 0.03), *samples, p)
    monkeypatch.setattr(tilt_filter, "can_compile", lambda: False)
    monkeypatch.setattr(tilt_filter, "_compiled", lambda: pytest.fail("it was compiled"))
    plain_x, plain_triggered = run_tilt(TiltStart(LEVEL, 0.03), *samples, p)

    np.testing.assert_allclose(plain_x, x, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(plain_triggered, triggered)


def test_exact_propagation_follows_a_fast_constant_rotation():
    # The accelerometer counts for nothing here, so that the gyro alone carries the tilt.
    rate, dt, n = np.array([9.0, -20.0, 11.0]), 1 / 285.71, 2000
    p = TiltParameters(sigma_accel_mps2=1e9, exact=True, adapt="none")
    x, _ = run_tilt(TiltStart(LEVEL, 1e-3), np.tile(rate, (n, 1)), np.zeros((n, 3)), np.full(n, dt), p)
    truth = Rotation.from_rotvec(rate * dt * np.arange(1, n + 1)[:, None]).inv().apply(LEVEL)
    np.testing.assert_allclose(x, truth, atol=1e-10)


def accelerating(adapt, rest, moving):
    """Pitch and trigger of a level robot that rests, then accelerates forwards with 1 m/s2."""
    n = rest + moving
    accel = np.tile([1.0, 0.0, G], (n, 1))
    accel[:rest, 0] = 0.0
    p = TiltParameters(adapt=adapt, sigma_accel_mps2=0.02)
    x, triggered = run_tilt(TiltStart(LEVEL, 1e-3), np.zeros((n, 3)), accel, np.full(n, 0.01), p)
    return roll_pitch(x)[1], triggered


def test_mtf_keeps_a_level_robot_level_while_it_accelerates():
    rest, moving, q = 800, 500, (0.01 * 0.0017) ** 2
    pitch, triggered = accelerating("mtf", rest, moving)
    np.testing.assert_array_equal(triggered, np.arange(rest + moving) >= rest)
    # With S = e^2 a step moves x by g P/e. P starts from its steady value at rest and grows by q a sample.
    steady = math.sqrt(q) * 0.02 / G
    drift = G * (moving * steady + q * moving**2 / 2) / 1.0
    assert -pitch[-1] == pytest.approx(drift, rel=0.02)
    assert drift < 0.01 * math.atan2(1.0, G)


def test_without_adaptation_the_tilt_goes_to_the_apparent_vertical():
    pitch, _ = accelerating("none", 200, 3000)
    assert pitch[-1] == pytest.approx(-math.atan2(1.0, G), abs=1e-4)


@pytest.mark.parametrize("adapt", ADAPTATIONS)
def test_external_variance_is_never_negative_and_x_has_length_one(adapt):
    samples = shaken(300, seed=1)
    p = TiltParameters(sigma_accel_mps2=0.3, external_memory=0.6, window=3, adapt=adapt)
    for n in (1, 2, 101, 102, 150, 299, 300):
        room, _ = after([array[:n] for array in samples], p)
        assert (room.noise >= p.sigma_accel_mps2**2).all()
        assert np.linalg.norm(room.x) == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_array_equal(room.P, room.P.T)


def test_after_mtf_no_axis_lies_outside_its_own_variance():
    samples, p, hits = shaken(200, seed=2), TiltParameters(sigma_accel_mps2=0.1), 0
    for n in range(60, 200):
        room, triggered = after([array[:n] for array in samples], p, loop=tilt_filter._compiled())
        if triggered[-1]:
            S = room.C0 - p.sigma_accel_mps2**2 + room.noise
            assert (room.e**2 <= S * (1 + 1e-12)).all()
            hits += 1
    assert hits > 10


def test_a_run_does_not_change_its_arguments():
    samples, start = shaken(20), TiltStart(LEVEL.copy(), 0.03)
    before = [array.copy() for array in (start.x, *samples)]
    run_tilt(start, *samples, TiltParameters(window=3))
    for array, copy in zip((start.x, *samples), before, strict=True):
        np.testing.assert_array_equal(array, copy)
