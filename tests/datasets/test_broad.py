"""Trials with a true attitude alone: BROAD and RepoIMU."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from jerkbench import plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.reference import GyroOnly
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.broad import _ACCEL, _ATTITUDE, _GYRO, Broad, RepoImu
from jerkbench.errors import RecordingError
from jerkbench.evaluation.counted_rows import angle_between
from jerkbench.evaluation.metrics.attitude import Inclination
from jerkbench.filters.attitude_only import AttitudeOnlyFilter
from jerkbench.geometry import best_rotation, vertical_in_body
from jerkbench.plugins.checks import check_plugin

RATE_HZ, REST_S, TURN_S = 100.0, 4.0, 2.0
TURN_RAD = 0.5


def trial_fields(**changes):
    """Rest, a roll of half a radian within two seconds, rest again; the gyro is biased."""
    n = int((2 * REST_S + TURN_S) * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    moving = (t > REST_S) & (t <= REST_S + TURN_S)
    rate = np.where(moving, TURN_RAD / TURN_S, 0.0)
    roll = np.cumsum(rate) / RATE_HZ
    zero = np.zeros(n)
    gyro = np.column_stack([rate, zero, zero]) + np.array([0.002, -0.001, 0.003])
    quaternion = np.column_stack([np.cos(roll / 2), np.sin(roll / 2), zero, zero])
    quaternion[:30] = quaternion[450:460] = np.nan
    fields = {
        "imu_acc": 9.81 * np.column_stack([zero, np.sin(roll), np.cos(roll)]),
        "imu_gyr": gyro,
        "opt_quat": quaternion,
        "movement": moving,
        "sampling_rate": RATE_HZ,
    }
    return {name: value for name, value in (fields | changes).items() if value is not None}


def write_hdf5(path, fields):
    import h5py

    with h5py.File(path, "w") as file:
        for name, value in fields.items():
            if name == "sampling_rate":
                file.attrs[name] = value
            else:
                file[name] = value


def write_matlab(path, fields):
    from scipy.io import savemat

    savemat(path, fields | {"movement": fields["movement"].astype(np.uint8)[:, None]})


@pytest.mark.parametrize(("write", "name"), [(write_hdf5, "07_x.hdf5"), (write_matlab, "07_x.mat")])
def test_both_kinds_of_file_hold_the_same_trial(tmp_path, write, name):
    fields = trial_fields()
    write(tmp_path / name, fields)
    recording = Broad(str(tmp_path), trial=7).load(0)

    assert (recording.name, recording.position, recording.velocity) == ("07_x", None, None)
    np.testing.assert_allclose(recording.imu.t_s, np.arange(1000) / 100)
    np.testing.assert_allclose(recording.imu.gyro_radps[:, 0], fields["imu_gyr"][:, 0] - 0.002, atol=1e-12)
    known = np.isfinite(fields["opt_quat"][:, 0])
    assert recording.reference.scored.sum() == (fields["movement"] & known).sum() == 190
    np.testing.assert_allclose(recording.reference.euler_rad[-1], [TURN_RAD, 0, np.nan], atol=1e-9)
    assert recording.static_start_s == pytest.approx(REST_S - 1 + 0.01)
    check_plugin("dataset", Broad(str(tmp_path), trial=7))
    biased = Broad(str(tmp_path), trial=7, remove_gyro_bias=False).load(0).imu
    np.testing.assert_allclose(biased.gyro_radps[0], [0.002, -0.001, 0.003])


@pytest.mark.parametrize("attitude", [Tilt("none", propagation="exact"), GyroOnly()])
def test_a_perfect_imu_has_no_inclination_error(tmp_path, attitude):
    write_hdf5(tmp_path / "07_x.hdf5", trial_fields())
    recording = Broad(str(tmp_path), trial=7).load(0)
    estimate = AttitudeOnlyFilter().estimate(recording, attitude.estimate(recording), NoAdaptation())
    values = Inclination().evaluate(estimate, recording, recording.reference.scored[estimate.index])

    assert values["inclination_rmse_deg"] < 1e-6
    assert values["inclination_floor_deg"] < 1e-6


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"imu_acc": None}, "no field imu_acc"),
        ({"opt_quat": np.zeros((1000, 3))}, r"opt_quat has shape \(1000, 3\); it must be .* shape \(1000, 4\)"),
        ({"movement": np.zeros(5, dtype=bool)}, r"movement has shape \(5,\)"),
        ({"sampling_rate": -1.0}, "sampling_rate is -1"),
        ({"sampling_rate": None}, "sampling_rate is None"),
        ({"imu_acc": np.full((1000, 3), 1e300)}, "imu_acc, row 1 has a value beyond 1000; it is damaged"),
        ({"imu_gyr": np.full((1000, 3), np.nan)}, "gyro_radps row 0"),
    ],
)
def test_a_damaged_trial_is_a_sentence(tmp_path, changes, said):
    write_hdf5(tmp_path / "07_x.hdf5", trial_fields(**changes))
    with pytest.raises(RecordingError, match=said):
        Broad(str(tmp_path), trial=7).load(0)


@pytest.mark.parametrize("ending", [".hdf5", ".mat"])
@pytest.mark.parametrize("content", [b"", b"nonsense", b"\x89HDF\r\n\x1a\n" + bytes(100)])
def test_a_file_that_is_none_is_a_sentence(tmp_path, ending, content):
    (tmp_path / f"07_x{ending}").write_bytes(content)
    with pytest.raises(RecordingError, match="07_x"):
        Broad(str(tmp_path), trial=7).load(0)


def test_a_trial_that_is_not_there_names_those_that_are(tmp_path):
    write_hdf5(tmp_path / "07_x.hdf5", trial_fields())
    with pytest.raises(RecordingError, match=r"0 files whose names start with '08_'.*Available: 07_x\.hdf5"):
        Broad(str(tmp_path), trial=8).fingerprint()
    with pytest.raises(RecordingError, match="There is no folder"):
        Broad(str(tmp_path / "away"), trial=8).load(0)


def test_the_real_trials_have_the_published_facts(shared_folder):
    """The floor lies where other people's methods find it: medians of .10 to .43 degrees."""
    for number, bias_dps in ((16, 0.36), (21, 0.31), (25, 0.59)):
        recording = Broad(str(shared_folder / "data" / "broad"), number).load(0)
        raw = Broad(str(shared_folder / "data" / "broad"), number, remove_gyro_bias=False).load(0)
        removed = (raw.imu.gyro_radps - recording.imu.gyro_radps)[0]
        assert np.degrees(np.linalg.norm(removed)) == pytest.approx(bias_dps, abs=0.01)
        rows = np.flatnonzero(recording.reference.scored)
        estimate = AttitudeOnlyFilter().estimate(recording, GyroOnly().estimate(recording), NoAdaptation())
        values = Inclination().evaluate(estimate, recording, recording.reference.scored)
        assert 1 / recording.imu.nominal_interval_s == pytest.approx(285.71, abs=0.01)
        assert 0.09 < values["inclination_floor_deg"] < 0.43
        assert recording.reference.t_s[rows[0]] == pytest.approx(recording.static_start_s + 1, abs=0.01)


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


def test_a_trial_is_a_recording_with_an_attitude_alone_whose_bias_may_stay(folder):
    recording = RepoImu(str(folder), 3, 2).load()
    assert recording.name == "TStick_Test03_Trial2"
    assert recording.static_start_s == pytest.approx(2.0)
    assert recording.position is None
    assert recording.imu.t_s[0] == 0.0
    np.testing.assert_allclose(recording.imu.gyro_radps, 0.0, atol=1e-15)
    np.testing.assert_allclose(recording.reference.euler_rad[:, :2], np.tile([0.3, 0.0], (600, 1)), atol=1e-12)
    assert np.isnan(recording.reference.euler_rad[:, 2]).all()
    np.testing.assert_array_equal(recording.reference.scored, np.arange(600) >= 300)
    gyro = RepoImu(str(folder), 3, 2, remove_gyro_bias=False).load().imu.gyro_radps
    np.testing.assert_allclose(gyro[7], [0.01, -0.02, 0.03])
    check_plugin(
        "dataset", plugins.create("dataset", {"name": "repoimu", "folder": str(folder), "test": 3, "trial": 2})
    )


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


def test_the_reference_is_turned_upright_and_does_not_count_where_it_contradicts_gravity(turned):
    folder, vertical = turned
    found, published = (
        vertical_in_body(np.nan_to_num(RepoImu(str(folder), 4, align_reference=align).load().reference.euler_rad))
        for align in (True, False)
    )
    assert angle_between(found, vertical)[:4000].max() < 0.003
    assert np.median(angle_between(published, vertical)[:4000]) > 0.03
    folder, _ = turned
    scored = RepoImu(str(folder), 4).load().reference.scored
    assert scored[300:3400].all()
    assert scored[4300:].mean() < 0.5
    assert RepoImu(str(folder), 4, align_reference=False).load().reference.scored[300:].all()


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


def test_the_best_rotation_is_the_true_one_and_never_a_reflection():
    rng = np.random.default_rng(3)
    C = Rotation.from_rotvec([0.4, -1.0, 0.2]).as_matrix()
    a = rng.normal(size=(20, 3))
    np.testing.assert_allclose(best_rotation(a @ C.T, a), C, atol=1e-12)
    mirrored = best_rotation(a @ np.diag([1.0, 1.0, -1.0]), a)
    assert np.linalg.det(mirrored) == pytest.approx(1.0)
