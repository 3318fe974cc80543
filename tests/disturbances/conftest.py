import numpy as np
import pytest

from jerkbench.recording import Heading, Imu, Position, Recording, Reference, Velocity


def make_recording(duration_s=120.0, rate_hz=4, **changes):
    t_s = np.arange(round(duration_s * rate_hz) + 1) / rate_hz
    m = len(t_s)
    enu_m = np.column_stack([t_s, 2 * t_s, 0.1 * t_s])
    eye = np.tile(np.eye(3), (m, 1, 1))
    imu_t_s = np.arange(round(duration_s * 20) + 1) / 20
    parts = {
        "name": "made",
        "imu": Imu(imu_t_s, np.tile([0, 0, 9.81], (len(imu_t_s), 1)), np.zeros((len(imu_t_s), 3))),
        "reference": Reference(t_s, "the fixes", independent=False, enu_m=enu_m, scored=t_s >= 3),
        "position": Position(t_s, enu_m, eye * 1e-4),
        "velocity": Velocity(t_s, np.ones((m, 3)), eye * 1e-3),
        "heading": Heading(t_s, np.zeros(m), np.full(m, 0.01)),
    }
    return Recording(**(parts | changes))


@pytest.fixture
def recording():
    return make_recording()


@pytest.fixture(scope="session")
def make():
    return make_recording
