import numpy as np
import pytest

from bag_maker import ROS1, START_NS, fix, imu, message, odometry, vector, write_bag
from jerkbench.datasets.rosbag import RosBag
from jerkbench.errors import PluginError, RecordingError

SECOND = 10**9


def twist(store, ns, v, covariance):
    body = message(store, "geometry_msgs/msg/Twist", vector(store, v), vector(store, (0, 0, 0)))
    both = message(store, "geometry_msgs/msg/TwistWithCovariance", body, np.asarray(covariance, dtype=float))
    stamp = message(store, "builtin_interfaces/msg/Time", ns // SECOND, ns % SECOND)
    header = message(store, "std_msgs/msg/Header", *([0] if store is ROS1 else []), stamp, "")
    name = "geometry_msgs/msg/TwistWithCovarianceStamped"
    return name, message(store, name, header, both)


def rows(rate_hz, make, seconds=4.0, delay_ns=0):
    stamps = [START_NS + k * SECOND // rate_hz for k in range(round(seconds * rate_hz))]
    return [[ns + delay_ns, *make(ns, (ns - START_NS) * 1e-9)] for ns in stamps]


def noisy(rng, value, sigma=1e-3):
    return np.asarray(value) + sigma * rng.normal(size=3)


def bag(path, more=None, accel=(0, 0, 9.8), store=ROS1):
    """An IMU at 50 Hz, slower ones that are to be passed over, fixes and two odometries."""
    path.unlink(missing_ok=True)
    rng = np.random.default_rng(1)
    topics = {
        "/imu": rows(50, lambda ns, t: imu(store, ns, noisy(rng, accel), noisy(rng, (0.1, 0.2, 0.3)))),
        "/imu_slow": rows(10, lambda ns, t: imu(store, ns, noisy(rng, accel), noisy(rng, (0, 0, 0)))),
        "/imu_zeros": rows(100, lambda ns, t: imu(store, ns, (0, 0, 0))),
        "/fix": rows(5, lambda ns, t: fix(store, ns, 0.0, 10.0 + t * 1e-5, 7.0, (1, 4, 9))),
        "/fix_none": rows(10, lambda ns, t: fix(store, ns, status=-1)),
        "/odom": rows(20, lambda ns, t: odometry(store, ns, (t, 0, 0), (0, 0, 0, 1), (1, 0.5, 0.25))),
        "/odom_slow": rows(2, lambda ns, t: odometry(store, ns, (t, 2 * t, -t), (0, 0, 0, 1), (1, 2, 3))),
    }
    return str(write_bag(path, topics | (more or {}), store))


def test_without_a_map_topics_are_guessed_and_said_and_a_map_is_followed_without_a_word(tmp_path):
    recording = RosBag(bag(tmp_path / "a.bag")).load(0)
    assert len(recording.imu.t_s) == 200
    assert len(recording.position.t_s) == 20
    assert len(recording.velocity.t_s) == 80
    assert recording.heading is None
    assert recording.reference.empty
    said = "\n".join(recording.notes)
    assert "Topic of the IMU, guessed: /imu (200 messages; it measures 9.80 m/s2; not /imu_zeros, /imu_slow)." in said
    assert "Topic of the positions, guessed: /fix (20 messages; it has fixes; not /fix_none)." in said
    assert "Topic of the velocities, guessed: /odom (80 messages; the most messages; not /odom_slow)." in said
    np.testing.assert_allclose(recording.position.covariance_m2[0], np.diag([1.0, 4.0, 9.0]))  # east, north, up
    given = {"imu_topic": "/imu_slow", "position_topic": "/fix", "velocity_topic": "none"}
    recording = RosBag(bag(tmp_path / "a.bag"), **given).load(0)
    assert len(recording.imu.t_s) == 40
    assert recording.velocity is None
    assert recording.notes == ()
    remarked = RosBag(str(tmp_path / "a.bag"), remarks=("It rained.",), **given).load(0)
    assert remarked.notes == ("It rained.",)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"imu_topic": "/fix"},
            r"has the type sensor_msgs/msg/NavSatFix, which contains no imu. .* Topics of these types: /imu, /imu_s",
        ),
        ({"imu_topic": "/imuu"}, r"There is no topic '/imuu'\. Did you mean '/imu'\?"),
        ({"reference_topic": "/imu"}, "which contains no reference"),
        ({"imu_topic": "/imu_zeros"}, r"imu \(/imu_zeros\): 0 usable messages are left.*frozen angular rate"),
        ({"remove_gyro_bias": True, "velocity_topic": "none"}, "stationary for 0.00 s"),
    ],
)
def test_what_does_not_fit_is_a_sentence(tmp_path, given, said):
    with pytest.raises(RecordingError, match=said):
        RosBag(bag(tmp_path / "a.bag"), **given).load(0)


@pytest.mark.parametrize("name", ["position_frame", "velocity_frame", "reference_frame", "heading_source"])
def test_choices_are_checked(name):
    with pytest.raises(PluginError, match=f"There is no {name} 'sideways'"):
        RosBag("a.bag", **{name: "sideways"})


def test_no_imu_with_gravity_and_no_fixes_are_sentences(tmp_path):
    with pytest.raises(RecordingError, match="/imu_zeros, /imu, /imu_slow"):
        RosBag(bag(tmp_path / "a.bag", accel=(0, 0, 0.1))).load(0)
    path = bag(tmp_path / "b.bag", more={"/fix": []})
    with pytest.raises(RecordingError, match="has no topic with GNSS fixes"):
        RosBag(path).load(0)


def test_an_imu_in_g_and_deg_per_s_is_found_said_and_scaled(tmp_path):
    path = bag(tmp_path / "a.bag", accel=(0, 0, 1.0))
    guessed = RosBag(path).load(0)
    scaled = RosBag(path, accel_unit="g", gyro_unit="deg/s").load(0)

    assert any("it measures 1.00, which is gravity in g" in note for note in guessed.notes)
    np.testing.assert_allclose(scaled.imu.accel_mps2, 9.80665 * guessed.imu.accel_mps2)
    np.testing.assert_allclose(scaled.imu.gyro_radps, np.radians(guessed.imu.gyro_radps))


def test_the_imu_is_turned_into_the_body(tmp_path):
    path = bag(tmp_path / "a.bag", accel=(0, 9.8, 0))
    imu = RosBag(path, imu_axes=("-z", "-x", "y")).load(0).imu
    np.testing.assert_allclose(imu.accel_mps2.mean(axis=0), [0, 0, 9.8], atol=1e-3)
    np.testing.assert_allclose(imu.gyro_radps.mean(axis=0), [-0.3, -0.1, 0.2], atol=1e-3)
    pitched = RosBag(path, imu_axes=("-z", "-x", "y"), mounting_deg=(0.0, 30.0, 0.0)).load(0).imu
    half, root = 9.8 / 2, 9.8 * np.sqrt(3) / 2  # the IMU is pitched nose down: its z leans forward
    np.testing.assert_allclose(pitched.accel_mps2.mean(axis=0), [-half, 0, root], atol=2e-3)


def test_poses_and_headings_in_a_local_ned_become_enu_about_the_first(tmp_path):
    given = {"position_topic": "/odom_slow", "velocity_topic": "/odom_slow", "position_frame": "ned"}
    recording = RosBag(bag(tmp_path / "a.bag"), velocity_frame="frd", **given).load(0)
    assert recording.origin is None
    np.testing.assert_allclose(recording.position.enu_m[-1], 3.5 * np.array([2, 1, 1]))
    np.testing.assert_array_equal(recording.velocity.mps[0], [1, -2, -3])
    assert recording.velocity.frame == "body"
    assert any("Position and velocity are of the same topic" in note for note in recording.notes)
    ned = RosBag(str(tmp_path / "a.bag"), velocity_frame="ned", **given).load(0).velocity
    np.testing.assert_array_equal(ned.mps[0], [2, 1, -3])
    assert ned.frame == "enu"
    quarter = (0, 0, np.sqrt(0.5), np.sqrt(0.5))  # 90 degrees clockwise from north: east
    more = {"/ned": rows(5, lambda ns, t: odometry(ROS1, ns, (t, 0, 0), quarter))}
    given = {"position_topic": "/ned", "heading_topic": "/ned", "position_frame": "ned", "velocity_topic": "none"}
    heading = RosBag(bag(tmp_path / "a.bag", more), **given).load(0).heading
    np.testing.assert_allclose(heading.yaw_rad, 0, atol=1e-12)


def test_a_speed_along_the_course_and_an_axis_that_was_not_measured(tmp_path):
    velocity = (
        RosBag(bag(tmp_path / "a.bag"), velocity_frame="speed", velocity_latency_s=(0.1, 0.1, 0.1)).load(0).velocity
    )
    assert velocity.frame == "speed"
    np.testing.assert_array_equal(velocity.mps[0], [1, np.nan, np.nan])
    assert velocity.t_s[0] == pytest.approx(-0.1)
    covariance = np.diag([0.04, 0.09, -1, 0, 0, 0]).ravel()
    more = {"/gnss_velocity": rows(5, lambda ns, t: twist(ROS1, ns, (1, 2, 0), covariance))}
    velocity = RosBag(bag(tmp_path / "a.bag", more), velocity_frame="enu").load(0).velocity
    np.testing.assert_array_equal(velocity.mps[0], [1, 2, np.nan])
    np.testing.assert_allclose(np.diag(velocity.covariance_m2ps2[0])[:2], [0.04, 0.09])
    ned = RosBag(str(tmp_path / "a.bag"), velocity_frame="ned").load(0).velocity
    np.testing.assert_array_equal(ned.mps[0], [2, 1, np.nan])
    np.testing.assert_allclose(np.diag(ned.covariance_m2ps2[0])[:2], [0.09, 0.04])


def test_times_are_the_headers_or_the_bags_less_their_latencies(tmp_path):
    more = {"/fix": rows(5, lambda ns, t: fix(ROS1, ns, 0.0, 10.0 + t * 1e-5), delay_ns=70_000_000)}
    path = bag(tmp_path / "a.bag", more)
    assert RosBag(path).load(0).position.t_s[0] == 0.0
    assert RosBag(path, time_source="bag").load(0).position.t_s[0] == pytest.approx(0.07)
    late = RosBag(path, position_latency_s=0.1, imu_shift_s=-0.2).load(0)
    assert (late.imu.t_s[0], late.position.t_s[0]) == (0.0, pytest.approx(0.1))
    assert RosBag(path, velocity_latency_s=(0.3, 0.3, 0.3)).load(0).velocity.t_s[0] == pytest.approx(-0.3)
    apart = RosBag(path, velocity_latency_s=(0.1, 0.1, 0.3), velocity_frame="enu").load(0).velocity
    np.testing.assert_array_equal(apart.mps[0], [np.nan, np.nan, 0.25])
    with pytest.raises(PluginError, match="frame body"):
        RosBag(path, velocity_latency_s=(0.1, 0.1, 0.3)).load(0)


def test_a_twist_that_is_never_filled_in_is_not_guessed_as_the_velocity(tmp_path):
    """As /odometry/gps of robot_localization, which has only positions."""
    still = rows(50, lambda ns, t: odometry(ROS1, ns, (t, 0, 0), (0, 0, 0, 1), (0, 0, 0)))
    recording = RosBag(bag(tmp_path / "a.bag", {"/odometry/gps": still})).load(0)
    assert any("velocities, guessed: /odom (80 messages" in note for note in recording.notes)


@pytest.mark.parametrize("name", ["/truth/fix", "/gt_fix", "/ground_truth"])
def test_a_topic_whose_name_says_truth_is_not_guessed_as_the_fixes(tmp_path, name):
    exact = rows(100, lambda ns, t: fix(ROS1, ns, lat=t * 1e-5))
    recording = RosBag(bag(tmp_path / "a.bag", {name: exact})).load(0)
    assert any(
        f"positions, guessed: /fix (20 messages; it has fixes; not /fix_none, {name})" in note
        for note in recording.notes
    )
    assert any(f"if it is one, set reference_topic={name}." in note for note in recording.notes)


def test_origin_and_reference_are_as_configured_and_never_guessed(tmp_path):
    path = bag(tmp_path / "a.bag")
    recording = RosBag(path, origin=(0.0, 10.0, 5.0), position_topic="/fix", reference_topic="/fix").load(0)
    np.testing.assert_allclose(recording.position.enu_m[0], [0, 0, 2], atol=1e-9)
    np.testing.assert_array_equal(recording.reference.enu_m, recording.position.enu_m)
    assert not recording.reference.independent
    slow = {"position_topic": "/odom", "reference_topic": "/odom_slow", "reference_source": "a total station"}
    other = RosBag(path, reference_independent=True, **slow).load(0)
    assert (other.reference.source, other.reference.independent) == ("a total station", True)
    same = RosBag(path, position_topic="/odom", reference_topic="/odom", reference_independent=True).load(0)
    assert not same.reference.independent  # a topic is not independent of itself
    given = {"position_topic": "/fix", "reference_topic": "/odom", "velocity_topic": "none"}
    recording = RosBag(path, origin=(0.0, 10.0, 7.0), **given).load(0)
    np.testing.assert_allclose(recording.reference.enu_m[:, 0], np.arange(80) / 20, atol=1e-9)
    np.testing.assert_allclose(recording.position.enu_m[-1, 0], 3.8 * 1e-5 * np.radians(1) * 6_378_144, rtol=1e-6)
    with pytest.raises(RecordingError, match="To compare the topic and the fixes, give origin"):
        RosBag(path, **given).load(0)
    recording = RosBag(bag(tmp_path / "a.bag"), reference_topic="/odom", origin=(0.0, 10.0, 7.0)).load(0)
    assert any("guessed: /odom_slow" in note for note in recording.notes)
