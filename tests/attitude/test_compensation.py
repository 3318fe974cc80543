import json

import numpy as np
import pytest

from jerkbench.attitude.common import compensate_gravity
from jerkbench.geometry import dcm_from_euler, roll_pitch

EULER = np.array([[0.1, -0.2, 0.3], [0.2, 0.1, 0.5], [-0.1, 0.0, 3.0]])
FORCE = np.array([[0.5, 0.2, 9.9], [-0.3, 0.4, 9.7], [1.0, 0.0, 9.81]])


def naive_dcm(roll, pitch, yaw):
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    Rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return Rz @ Ry @ Rx


def test_the_reference_values(shared_folder):
    case = json.loads((shared_folder / "reference" / "golden.json").read_text())["gravity_compensation"]
    given, wanted = case["inputs"], case["outputs"]
    dcm = dcm_from_euler(np.array([*roll_pitch(np.array(given["x"])), given["yaw"]]))
    np.testing.assert_allclose(dcm, wanted["Omega"], rtol=0, atol=1e-10)
    u = compensate_gravity(dcm[None], np.array([given["f_body"]]), "endpoint")
    np.testing.assert_allclose(u[0], wanted["u"], rtol=0, atol=1e-10)


@pytest.mark.parametrize("compensation", ["midpoint", "endpoint"])
def test_each_sample_by_itself(compensation):
    Omega = [naive_dcm(*euler) for euler in EULER]
    wanted = []
    for k in range(3):
        turn = (Omega[k - 1] + Omega[k]) / 2 if compensation == "midpoint" and k else Omega[k]
        wanted.append(turn @ FORCE[k] - [0, 0, 9.81])
    got = compensate_gravity(dcm_from_euler(EULER), FORCE, compensation)
    np.testing.assert_allclose(got, wanted, atol=1e-14)
