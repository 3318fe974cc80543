import numpy as np
import pytest

from jerkbench.datasets.path import DrivenPath
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler
from synthetic import integrated

PERFECT = {"noise": False, "accel_range_g": None}
SMOOTH = {**PERFECT, "vibration_mps2": 0.0, "vibration_rad": 0.0}
RADIUS_M, RATE_RADPS = 20.0, 0.1


def circle(t_s):
    """2 m/s to the left, climbing .1 m/s, from (20, 0, 5) on."""
    a = RATE_RADPS * t_s
    return np.column_stack([RADIUS_M * np.cos(a), RADIUS_M * np.sin(a), 5 + 0.1 * t_s])


@pytest.fixture
def table(tmp_path):
    def write(t_s, enu_m, header="t_s,east_m,north_m,up_m\n"):
        path = tmp_path / "drive.csv"
        rows = "\n".join(",".join(repr(float(x)) for x in row) for row in np.column_stack([t_s, enu_m]))
        path.write_text(header + rows + "\n")
        return str(path)

    return write


@pytest.mark.parametrize("source", ["waypoints", "table"])
def test_integrating_the_imu_returns_the_truth(source, table):
    t_s = np.linspace(0, 60, 121)
    file = table(t_s, circle(t_s)) if source == "table" else ""
    recording = DrivenPath(**PERFECT, file=file).load(1)
    p, v = integrated(recording)
    np.testing.assert_allclose(v, recording.reference.velocity_mps[-1], atol=1e-9)
    np.testing.assert_allclose(p, recording.reference.enu_m[-1], atol=2e-3)
    gyro = recording.imu.gyro_radps
    from scipy.spatial.transform import Rotation

    omega = Rotation.from_euler("ZYX", recording.reference.euler_rad[0, ::-1])
    for w in gyro[1:]:
        omega = omega * Rotation.from_rotvec(0.01 * w)
    np.testing.assert_allclose(omega.as_matrix(), dcm_from_euler(recording.reference.euler_rad[-1]), atol=1e-9)


def test_a_straight_line_against_the_closed_form():
    """30 m east and 40 m north at 2 m/s: 3 s rest, ramps of 4 s, 50 m in all, 32 s."""
    path = DrivenPath(**SMOOTH, waypoints_m=((0.0, 0.0), (30.0, 40.0)), speed_mps=2.0, ramp_s=4.0)
    recording = path.load(0)
    reference = recording.reference
    assert recording.duration_s == pytest.approx(3 + 25 + 4)
    np.testing.assert_allclose(reference.enu_m[-1], [30, 40, 0], atol=1e-9)
    t = reference.t_s
    steady = (t > 7) & (t < 28)
    np.testing.assert_allclose(reference.velocity_mps[steady], np.tile([1.2, 1.6, 0], (steady.sum(), 1)), atol=1e-9)
    np.testing.assert_allclose(reference.euler_rad, np.tile([0, 0, np.arctan2(4, 3)], (len(t), 1)), atol=1e-9)
    assert (reference.velocity_mps[t <= 3] == 0).all()
    np.testing.assert_allclose(np.linalg.norm(reference.enu_m[steady], axis=1), 2 * (t[steady] - 5), atol=1e-9)
    assert recording.static_start_s == 3.0


def test_the_spline_passes_its_waypoints_at_its_speed_and_points_along_its_way():
    points = ((0.0, 0.0, 0.0), (20.0, 5.0, 1.0), (30.0, 30.0, -1.0), (0.0, 40.0, 2.0))
    reference = DrivenPath(**SMOOTH, waypoints_m=points).load(0).reference
    for point in points:
        assert np.linalg.norm(reference.enu_m - point, axis=1).min() < 0.02
    speed = np.linalg.norm(reference.velocity_mps, axis=1)
    steady = (reference.t_s > 6.1) & (reference.t_s < reference.t_s[-1] - 3.2)
    np.testing.assert_allclose(speed[steady], 1.5, rtol=1e-4)
    np.testing.assert_allclose(np.diff(reference.enu_m, axis=0)[1000] / 0.01, reference.velocity_mps[1000], atol=0.01)
    moving = np.linalg.norm(reference.velocity_mps, axis=1) > 0.1
    v = reference.velocity_mps[moving]
    forward = dcm_from_euler(reference.euler_rad[moving])[:, :, 0]
    np.testing.assert_allclose(forward, v / np.linalg.norm(v, axis=1)[:, None], atol=1e-9)
    assert (reference.euler_rad[:, 0] == 0).all()


def test_a_table_gives_its_own_motion_back(table):
    """A circle against its closed form, at times that the table does not have; the table begins at 100 s."""
    t_s = np.arange(0, 60.1, 0.5)
    recording = DrivenPath(**SMOOTH, file=table(100 + t_s, circle(t_s), header="")).load(0)
    reference = recording.reference
    assert recording.duration_s == pytest.approx(60)
    assert recording.name == "drive"
    inner = (reference.t_s > 3) & (reference.t_s < 57)
    t = reference.t_s[inner]
    np.testing.assert_allclose(reference.enu_m[inner], circle(t), atol=1e-5)
    course = RATE_RADPS * t + np.pi / 2
    velocity = np.column_stack([2 * np.cos(course), 2 * np.sin(course), 0 * t + 0.1])
    np.testing.assert_allclose(reference.velocity_mps[inner], velocity, atol=1e-4)
    np.testing.assert_allclose(np.cos(reference.euler_rad[inner, 2] - course), 1, atol=1e-8)
    np.testing.assert_allclose(reference.euler_rad[inner, 1], -np.arctan(0.05), atol=1e-4)
    assert recording.static_start_s == 0.0


def test_smoothing_removes_most_of_the_noise_of_the_places(table):
    t_s = np.arange(0, 60.1, 0.2)
    noisy = circle(t_s) + 0.05 * np.random.default_rng(0).normal(size=(len(t_s), 3))
    file = table(t_s, noisy)
    errors, speeds = {}, {}
    for sigma in (0.0, 0.05):
        reference = DrivenPath(**SMOOTH, file=file, smoothing_m=sigma).load(0).reference
        inner = (reference.t_s > 3) & (reference.t_s < 57)
        errors[sigma] = (reference.enu_m[inner] - circle(reference.t_s[inner])).std()
        speeds[sigma] = np.linalg.norm(reference.velocity_mps[inner, :2], axis=1).std()
    assert errors[0.05] < 0.5 * errors[0.0]
    assert speeds[0.05] < 0.2 * speeds[0.0]


def test_where_it_stands_the_heading_goes_on_and_vibration_waits(table):
    t_s = np.arange(0, 30.1, 0.25)
    x = np.where(t_s < 5, 0.0, np.where(t_s < 15, 0.1 * (t_s - 5) ** 2, 10 + 2 * (t_s - 15)))
    recording = DrivenPath(**PERFECT, file=table(t_s, np.column_stack([0 * x, x, 0 * x]))).load(0)
    reference = recording.reference
    assert 4 <= recording.static_start_s <= 5.5
    rest = reference.t_s < recording.static_start_s - 0.5
    np.testing.assert_allclose(reference.euler_rad[rest], np.tile([0, 0, np.pi / 2], (rest.sum(), 1)), atol=1e-9)
    late = recording.imu.accel_mps2[recording.imu.t_s > 20, 2]
    assert late.std() == pytest.approx(0.3, rel=0.2)  # vibration at its full strength


def test_seeds_and_fingerprint(table):
    t_s = np.arange(0, 20.1, 0.5)
    file = table(t_s, circle(t_s))
    one, same, other = (DrivenPath(file=file).load(seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.imu.accel_mps2, same.imu.accel_mps2)
    assert (one.imu.accel_mps2 != other.imu.accel_mps2).any()
    before = DrivenPath(file=file).fingerprint()
    table(t_s, circle(t_s) + 1)
    assert DrivenPath(file=file).fingerprint() != before
    assert DrivenPath().fingerprint() == ""


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"waypoints_m": ((0.0, 0.0),)}, "give two or more"),
        ({"waypoints_m": ((0.0, 0.0), (1.0, 0.0, 0.0))}, "give two or more"),
        ({"waypoints_m": ((0.0,), (1.0,))}, "give two or more"),
        ({"waypoints_m": ((0.0, 0.0), (float("nan"), 1.0))}, "give two or more"),
        ({"waypoints_m": ((0.0, 0.0), (1.0, 0.0), (1.0, 0.0))}, "waypoints 1 and 2 of waypoints_m have the same"),
        ({"speed_mps": 0.0}, "speed_mps is 0.0"),
        ({"smoothing_m": -1.0}, "smoothing_m is -1.0"),
        ({"gnss_rate_hz": 7.0}, "integer multiple"),
        ({"imu": "tacticle"}, "no imu of dataset path 'tacticle'"),
    ],
)
def test_a_value_that_makes_no_sense_is_one_sentence(wrong, sentence):
    with pytest.raises(PluginError) as error:
        DrivenPath(**wrong)
    assert sentence in str(error.value)


def test_drives_that_are_too_short_and_files_that_hold_none_are_sentences(table, tmp_path):
    with pytest.raises(PluginError, match=r"the path is 2\.0 m long, but two ramps"):
        DrivenPath(waypoints_m=((0.0, 0.0), (2.0, 0.0))).load(0)
    with pytest.raises(RecordingError, match="There is no file"):
        DrivenPath(file=str(tmp_path / "no.csv")).fingerprint()
    t_s = np.arange(10.0)
    with pytest.raises(RecordingError, match="is never faster than 0"):
        DrivenPath(file=table(t_s, np.zeros((10, 3)))).load(0)
    with pytest.raises(RecordingError, match="row 3: the time is not later"):
        DrivenPath(file=table([0.0, 1.0, 0.5, 3.0], np.zeros((4, 3)))).load(0)
    with pytest.raises(RecordingError, match="has 3 positions"):
        DrivenPath(file=table(t_s[:3], np.zeros((3, 3)))).load(0)
    with pytest.raises(RecordingError, match="shorter than the interval between fixes"):
        DrivenPath(file=table(t_s[:4] / 100, circle(t_s[:4]))).load(0)
    (tmp_path / "odd.csv").write_text("t,e,n,u\n0,0,0,0\n1,1,x,0\n")
    with pytest.raises(RecordingError, match="row 2, column 3: 'x' is not a number"):
        DrivenPath(file=str(tmp_path / "odd.csv")).load(0)
