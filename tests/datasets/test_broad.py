"""Trials made by hand as HDF5 and MATLAB files, and the real ones where they are."""

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.gyro_only import GyroOnly
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.broad import Broad
from jerkbench.errors import RecordingError
from jerkbench.evaluation.metrics.attitude import Inclination
from jerkbench.filters.attitude_only import AttitudeOnlyFilter
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


def test_the_bias_stays_when_asked(tmp_path):
    write_hdf5(tmp_path / "07_x.hdf5", trial_fields())
    imu = Broad(str(tmp_path), trial=7, remove_gyro_bias=False).load(0).imu
    np.testing.assert_allclose(imu.gyro_radps[0], [0.002, -0.001, 0.003])


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
        ({"opt_quat": np.zeros((1000, 3))}, r"opt_quat has shape \(1000, 3\); it must be \(1000, 4\)"),
        ({"movement": np.zeros(5, dtype=bool)}, r"movement has shape \(5,\)"),
        ({"sampling_rate": -1.0}, "sampling_rate is -1"),
        ({"sampling_rate": None}, "sampling_rate is None"),
        ({"imu_acc": np.full((1000, 3), 1e300)}, "imu_acc, row 1 holds a value beyond 1000, which is damage"),
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
    with pytest.raises(RecordingError, match=r"0 files of trial 8.*there: 07_x\.hdf5"):
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
