import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.errors import JerkbenchError
from jerkbench.geometry import EULER_ORDERS, best_rotation, dcm_from_euler, euler_in_order


def about(axis, angle):
    """The elementary rotation, written out."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(
        {
            "X": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "Y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "Z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }[axis]
    )


@pytest.mark.parametrize("order", EULER_ORDERS)
def test_elementary_rotations_in_this_order_give_the_matrix_back(order):
    dcm = Rotation.random(20, random_state=3).as_matrix()
    angles = euler_in_order(dcm, order)
    for one, (a, b, c) in zip(dcm, angles, strict=True):
        np.testing.assert_allclose(about(order[0], a) @ about(order[1], b) @ about(order[2], c), one, atol=1e-12)


def test_there_are_twelve_and_zyx_is_ours():
    assert len(set(EULER_ORDERS)) == 12
    roll_pitch_yaw = np.array([[0.1, 0.2, 0.3], [-1.0, 1.2, -3.0]])
    np.testing.assert_allclose(
        euler_in_order(dcm_from_euler(roll_pitch_yaw), "ZYX"), roll_pitch_yaw[:, ::-1], atol=1e-12
    )


@pytest.mark.parametrize("order", ["zyx", "ZZX", "ZY", ""])
def test_another_order_is_a_sentence(order):
    with pytest.raises(JerkbenchError, match=f"no order of axes '{order}'"):
        euler_in_order(np.eye(3)[None], order)


def test_the_best_rotation_is_the_one_that_was_and_never_a_mirror():
    rng = np.random.default_rng(3)
    C = Rotation.from_rotvec([0.4, -1.0, 0.2]).as_matrix()
    a = rng.normal(size=(20, 3))
    np.testing.assert_allclose(best_rotation(a @ C.T, a), C, atol=1e-12)
    mirrored = best_rotation(a @ np.diag([1.0, 1.0, -1.0]), a)
    assert np.linalg.det(mirrored) == pytest.approx(1.0)
