"""The compiled tilt filter against the NumPy one, sample by sample."""

import itertools

import numpy as np
import pytest

from jerkbench.attitude.compiled_tilt import run_tilt_compiled
from jerkbench.attitude.external_acceleration import ADAPTATIONS
from jerkbench.attitude.plugin import Tilt
from jerkbench.attitude.tilt import TiltParameters, run_tilt, start_state, tilt_step
from jerkbench.recording import Heading
from synthetic import recording_at_rest


def shaken(n=600, seed=0):
    """Gyro and accelerometer of a body that turns and is pushed now and then; intervals that vary."""
    rng = np.random.default_rng(seed)
    gyro = rng.normal(0.0, 0.5, (n, 3))
    gyro[7] = 0.0
    accel = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.3, (n, 3))
    accel[100:160] += rng.normal(0.0, 4.0, (60, 3))
    return gyro, accel, rng.uniform(0.005, 0.02, n)


@pytest.mark.parametrize("adapt", ADAPTATIONS)
@pytest.mark.parametrize(
    ("exact", "normalise", "window", "memory"),
    [*itertools.product([False, True], [False, True], [1], [0.0, 0.7]), (True, True, 4, 0.2)],
)
def test_it_agrees_with_the_numpy_loop(adapt, exact, normalise, window, memory):
    data = shaken()
    p = TiltParameters(0.01, 0.3, memory, window, normalise, exact, adapt)
    start = start_state(np.array([0.1, -0.2, np.sqrt(0.95)]), 0.03)
    x, triggered = run_tilt_compiled(start, *data, p)
    wanted_x, wanted_triggered = run_tilt(start, *data, p)

    np.testing.assert_array_equal(triggered, wanted_triggered)
    assert 0 < triggered.sum() < len(triggered)
    assert np.abs(x - wanted_x).max() < 1e-10


def test_it_goes_on_from_any_state():
    gyro, accel, dt = shaken()
    p, state = TiltParameters(0.01, 0.3, 0.5, 5), start_state(np.array([0.0, 0.0, 1.0]), 0.03)
    for k in range(103):
        state = tilt_step(state, gyro[k], accel[k], dt[k], p).state
    before = [array.copy() for array in state]
    rest = gyro[103:200], accel[103:200], dt[103:200]
    x, _ = run_tilt_compiled(state, *rest, p)

    assert np.abs(x - run_tilt(state, *rest, p)[0]).max() < 1e-10
    for array, copy in zip(state, before, strict=True):
        np.testing.assert_array_equal(array, copy)  # what is given is not changed


def test_the_plugin_takes_it_when_asked(monkeypatch):
    recording = recording_at_rest(duration_s=5.0, heading=Heading([0.1], [0.3], [0.01]))
    numpy_loop, compiled = Tilt().estimate(recording), Tilt(compiled=True).estimate(recording)
    monkeypatch.setattr("jerkbench.attitude.plugin.run_tilt", lambda *_: pytest.fail("the NumPy loop ran"))
    again = Tilt(compiled=True).estimate(recording)

    np.testing.assert_allclose(compiled.dcm, numpy_loop.dcm, atol=1e-10)
    np.testing.assert_array_equal(again.dcm, compiled.dcm)
