import numpy as np
import pytest

from bag_maker import ROS1, ROS2, START_NS, fix, imu, odometry
from jerkbench.io.bag_decode import _STRING, BLOCKS, LAYOUTS, decode, decode_each, decode_grid


def serialised(store, make, count, **changing):
    """Random messages in the store's own serialisation, and its deserialiser."""
    draw = np.random.default_rng(count)
    raw = []
    for k in range(count):
        name, one = make(store, START_NS + 7 * k, draw, **{key: value(k) for key, value in changing.items()})
        raw.append(bytes(store.serialize_ros1(one, name) if store is ROS1 else store.serialize_cdr(one, name)))
    return raw, name, (store.deserialize_ros1 if store is ROS1 else store.deserialize_cdr)


def an_imu(store, ns, draw, frame="imu"):
    return imu(store, ns, draw.normal(size=3), draw.normal(size=3), draw.normal(size=4), frame)


def a_fix(store, ns, draw, frame="gnss"):
    return fix(store, ns, *draw.normal(size=3), draw.normal(size=9), int(draw.integers(-1, 3)), frame)


def an_odometry(store, ns, draw, frame="odom", child="base"):
    pose, rest = draw.normal(size=3), (draw.normal(size=4), draw.normal(size=3), *draw.normal(size=2))
    return odometry(store, ns, pose, *rest, frame, child)


def fields(msgtype):
    names = [part.name for part in LAYOUTS[msgtype] if part.code != _STRING]
    return names + [block for block, (whole, _) in BLOCKS.items() if whole in names]


def by_layout(raw, msgtype, *, cdr):
    """What the layout alone gives; None where it does not fit, or the lengths differ."""
    if len(set(map(len, raw))) > 1 or not raw[0]:
        return None
    return decode_grid(np.array([list(one) for one in raw], dtype=np.uint8), msgtype, fields(msgtype), cdr=cdr)


def assert_same(fast, slow):
    assert fast.strings == slow.strings
    np.testing.assert_array_equal(fast.stamp_ns, slow.stamp_ns)
    assert fast.values.keys() == slow.values.keys()
    for name in fast.values:
        np.testing.assert_array_equal(fast.values[name], slow.values[name])


@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "abcd", "Frame_mit_Ümlaut"])
@pytest.mark.parametrize("make", [an_imu, a_fix, an_odometry])
@pytest.mark.parametrize("store", [ROS1, ROS2])
def test_the_layout_gives_the_deserialisers_numbers_to_the_bit(store, make, frame):
    raw, msgtype, deserialise = serialised(store, make, 20, frame=lambda _: frame)
    assert by_layout(raw, msgtype, cdr=store is ROS2) is not None
    fast = decode(raw, msgtype, fields(msgtype), deserialise, cdr=store is ROS2)
    assert_same(fast, decode_each(raw, msgtype, fields(msgtype), deserialise))


@pytest.mark.parametrize("frame", [lambda k: "a" * k, lambda k: f"frame{k % 3}"])
@pytest.mark.parametrize("store", [ROS1, ROS2])
def test_strings_that_change_are_left_to_the_deserialiser(store, frame):
    raw, msgtype, deserialise = serialised(store, an_odometry, 9, child=frame)
    assert by_layout(raw, msgtype, cdr=store is ROS2) is None
    decoded = decode(raw, msgtype, ["position"], deserialise, cdr=store is ROS2)
    assert_same(decoded, decode_each(raw, msgtype, ["position"], deserialise))


def test_big_endian_is_left_to_the_deserialiser():
    name, one = an_imu(ROS2, START_NS, np.random.default_rng(0))
    raw = [bytes(ROS2.serialize_cdr(one, name, little_endian=False))]
    assert by_layout(raw, name, cdr=True) is None
    assert_same(
        decode(raw, name, fields(name), ROS2.deserialize_cdr, cdr=True),
        decode_each([bytes(ROS2.serialize_cdr(one, name))], name, fields(name), ROS2.deserialize_cdr),
    )


@pytest.mark.parametrize("cut", [0, 3, 9, 40, 200])
@pytest.mark.parametrize("store", [ROS1, ROS2])
def test_a_message_that_is_too_short_fits_no_layout(store, cut):
    raw, msgtype, _ = serialised(store, an_odometry, 2)
    assert by_layout([one[:cut] for one in raw], msgtype, cdr=store is ROS2) is None


@pytest.mark.parametrize("store", [ROS1, ROS2])
def test_messages_of_equal_layout_are_not_deserialised(store):
    """That makes it fast (benchmarks/bags.py measures how much)."""
    raw, msgtype, deserialise = serialised(store, an_imu, 20)

    def never(*_):
        raise AssertionError

    fast = decode(raw, msgtype, fields(msgtype), never, cdr=store is ROS2)
    assert_same(fast, decode_each(raw, msgtype, fields(msgtype), deserialise))


def test_blocks_are_the_right_ones():
    name, one = an_odometry(ROS1, START_NS, np.random.default_rng(0))
    one.pose.covariance[:] = np.arange(36)
    one.twist.covariance[:] = 100 + np.arange(36)
    raw = [bytes(ROS1.serialize_ros1(one, name))]
    block = decode(raw, name, list(BLOCKS), ROS1.deserialize_ros1, cdr=False).values
    np.testing.assert_array_equal(block["position_covariance"][0], [0, 1, 2, 6, 7, 8, 12, 13, 14])
    np.testing.assert_array_equal(block["orientation_covariance"][0], [21, 22, 23, 27, 28, 29, 33, 34, 35])
    np.testing.assert_array_equal(block["linear_covariance"][0], [100, 101, 102, 106, 107, 108, 112, 113, 114])
