import numpy as np

from bag_maker import ROS1, START_NS, odometry
from jerkbench.io.bag_decode import BLOCKS, decode


def test_blocks_are_the_right_ones():
    name, one = odometry(ROS1, START_NS, np.ones(3), np.ones(4), np.ones(3), 1.0, 1.0, "odom", "base")
    one.pose.covariance[:] = np.arange(36)
    one.twist.covariance[:] = 100 + np.arange(36)
    raw = [bytes(ROS1.serialize_ros1(one, name))]
    block = decode(raw, name, list(BLOCKS), ROS1.deserialize_ros1).values
    np.testing.assert_array_equal(block["position_covariance"][0], [0, 1, 2, 6, 7, 8, 12, 13, 14])
    np.testing.assert_array_equal(block["orientation_covariance"][0], [21, 22, 23, 27, 28, 29, 33, 34, 35])
    np.testing.assert_array_equal(block["linear_covariance"][0], [100, 101, 102, 106, 107, 108, 112, 113, 114])
