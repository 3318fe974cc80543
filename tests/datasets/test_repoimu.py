import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from jerkbench import plugins
from jerkbench.datasets.broad import _ACCEL, _ATTITUDE, _GYRO, RepoImu
from jerkbench.errors import RecordingError
from jerkbench.evaluation.counted_rows import angle_between
from jerkbench.geometry import vertical_in_body
from jerkbench.testing import check_plugin


@pytest.fixture
def folder(tmp_path):
    """Six seconds at rest with a gyro bias, rolled by .3 rad; the last three count."""
    n = 600
    values = {
        "t_s": 7.0 + np.arange(n) / 100,
        **dict(zip(_ACCEL, (0.0, 9.81 * np.sin(0.3), 9.81 * np.cos(0.3)), strict=True)),
    }
    values |= dict(zip(_GYRO, (0.01, -0.02, 0.03), strict=True))
    values |= dict(zip(_ATTITUDE, (np.cos(0.15), np.sin(0.15), 0.0, 0.0), strict=True))
    table = pd.DataFrame(values).assign(movement=(np.arange(n) >= 300).astype(int))
    table.to_parquet(tmp_path / "TStick_Test03_Trial2.parquet")
    return tmp_path


def test_a_trial_is_a_recording_with_an_attitude_alone(folder):
    recording = RepoImu(str(folder), 3, 2).load()
    assert recording.name == "TStick_Test03_Trial2"
    assert recording.static_start_s == pytest.approx(2.0)
    assert recording.position is None
    assert recording.imu.t_s[0] == 0.0
    np.testing.assert_allclose(recording.imu.gyro_radps, 0.0, atol=1e-15)
    np.testing.assert_allclose(recording.reference.euler_rad[:, :2], np.tile([0.3, 0.0], (600, 1)), atol=1e-12)
    assert np.isnan(recording.reference.euler_rad[:, 2]).all()
    np.testing.assert_array_equal(recording.reference.scored, np.arange(600) >= 300)


@pytest.fixture
def turned(tmp_path):
    """A minute of turns about all axes, and its true vertical; mounted and tilted reference, lost after 40 s."""
    t = np.arange(6000) / 100
    rate = np.sin(np.outer(t, [1.1, 0.7, 0.9])) * (t > 3.0)[:, None]
    truth = [Rotation.from_euler("YX", [0.1, 0.3])]
    for turn in Rotation.from_rotvec(rate[1:] / 100):
        truth.append(truth[-1] * turn)
    truth = Rotation.concatenate(truth)
    mount, tilt = Rotation.from_rotvec([0.05, 0.0, -0.02]), Rotation.from_rotvec([0.02, 0.03, 0.5])
    published = (tilt * truth * mount).as_quat(scalar_first=True)
    published[4000:] = published[4000]
    force = truth.inv().apply([0.0, 0.0, 9.81]) + np.random.default_rng(0).normal(0.0, 0.5, (6000, 3))
    columns = np.column_stack([7.0 + t, force, np.add(rate, [0.01, -0.02, 0.03]), published, t >= 3.0])
    table = pd.DataFrame(columns, columns=["t_s", *_ACCEL, *_GYRO, *_ATTITUDE, "movement"])
    table.to_parquet(tmp_path / "TStick_Test04_Trial1.parquet")
    return tmp_path, truth.inv().apply([0.0, 0.0, 1.0])


def test_the_reference_is_turned_into_the_axes_of_the_imu_and_upright(turned):
    folder, vertical = turned
    found, published = (
        vertical_in_body(np.nan_to_num(RepoImu(str(folder), 4, align_reference=align).load().reference.euler_rad))
        for align in (True, False)
    )
    assert angle_between(found, vertical)[:4000].max() < 0.003
    assert np.median(angle_between(published, vertical)[:4000]) > 0.03


def test_a_reference_that_contradicts_gravity_does_not_count(turned):
    folder, _ = turned
    scored = RepoImu(str(folder), 4).load().reference.scored
    assert scored[300:3400].all()
    assert scored[4300:].mean() < 0.5
    assert RepoImu(str(folder), 4, align_reference=False).load().reference.scored[300:].all()


def test_the_bias_may_stay(folder):
    gyro = RepoImu(str(folder), 3, 2, remove_gyro_bias=False).load().imu.gyro_radps
    np.testing.assert_allclose(gyro[7], [0.01, -0.02, 0.03])


def test_it_conforms(folder):
    check_plugin(
        "dataset", plugins.create("dataset", {"name": "repoimu", "folder": str(folder), "test": 3, "trial": 2})
    )


def test_what_is_wrong_is_one_sentence(folder):
    with pytest.raises(RecordingError, match="TStick_Test09_Trial1"):
        RepoImu(str(folder), 9).load()
    (folder / "TStick_Test04_Trial1.parquet").write_text("no Parquet")
    with pytest.raises(RecordingError, match=r"TStick_Test04_Trial1.parquet cannot be read as Parquet"):
        RepoImu(str(folder), 4).load()
    pd.read_parquet(folder / "TStick_Test03_Trial2.parquet").drop(columns="gx").to_parquet(
        folder / "TStick_Test05_Trial1.parquet"
    )
    with pytest.raises(RecordingError, match="gx"):
        RepoImu(str(folder), 5).load()
