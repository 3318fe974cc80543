"""Recordings with bad fixes: their errors against the better reference, as measured elsewhere on the same files."""

import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.jobs.names import choose
from jerkbench.plugins import create
from jerkbench.plugins.checks import check_plugin

FAR_M = 1.5
"""Over a longer interval the reference is not taken linearly."""


def loaded(preset, folder, **changes):
    return create("dataset", choose("dataset", {"name": preset, "folder": str(folder), **changes}).plain)


@pytest.fixture
def degraded(shared_folder):
    """Loads a recording of those that may not be here."""

    def load(preset, folder):
        path = shared_folder / "data" / "degraded" / folder
        if not path.is_dir():
            pytest.skip(f"{path.name} is not in ../shared/data/degraded")
        return loaded(preset, path).load(0)

    return load


def errors(recording, *, same_stamp=False):
    """Errors (n, 3) of the fixes at which the reference is known."""
    position, reference = recording.position, recording.reference
    rows = np.isfinite(reference.enu_m).all(axis=1)
    known_s, places = reference.t_s[rows], reference.enu_m[rows]
    after = np.clip(np.searchsorted(known_s, position.t_s), 1, len(known_s) - 1)
    use = (known_s[after] - known_s[after - 1] <= FAR_M) & (position.t_s >= known_s[0]) & (position.t_s <= known_s[-1])
    if same_stamp:
        use = np.minimum(abs(known_s[after] - position.t_s), abs(known_s[after - 1] - position.t_s)) < 1e-3
    truth = np.column_stack([np.interp(position.t_s, known_s, axis) for axis in places.T])
    return (position.enu_m - truth)[use]


def plane(error):
    """Root mean square, 95 % and largest horizontal error."""
    size = np.linalg.norm(error[:, :2], axis=1)
    return np.sqrt(np.mean(size**2)), np.percentile(size, 95), size.max()


def test_hamburg(degraded):
    recording = degraded("hamburg", "hamburg")
    error = errors(recording, same_stamp=True)
    assert recording.duration_s == pytest.approx(2701, abs=1)
    assert plane(error)[:2] == pytest.approx((5.5, 12.0), rel=0.03)
    assert np.sqrt(np.mean(error[:, 2] ** 2)) == pytest.approx(9.3, rel=0.03)


def test_beijing(degraded):
    recording = degraded("beijing_car", "beijing_car")
    error = errors(recording)
    assert recording.duration_s == pytest.approx(1156)
    assert plane(error) == pytest.approx((1.6, 2.7, 3.5), rel=0.02)
    rate = recording.reference.velocity_mps - recording.velocity.mps
    assert np.sqrt(np.mean(rate[:, :2] ** 2)) < 0.1  # the rows of both files belong together


def beijing_files(folder, epochs=6):
    table = [f"{k / 10}\t\t{k}\t{2 * k}\t{k - 0.5}\t{2 * k + 0.25}\t10\t20" for k in range(6)]
    (folder / "Data.txt").write_text("\n".join(["Time\t\tGPS_X\tGPS_Y\tRTK_X\tRTK_Y\tRTK_Vx\tRTK_Vy", *table]) + "\n")
    log = []
    for k in range(epochs):
        log += [f"$GPGGA,03000{k},1,2*11", f"$PSAT,FVI,03000{k}," + "," * 12 + f"10.{k},20.{k},0.1,22*3B"]
        log.append(f"$GPGST,03000{k},2,1,1,73,.5,.7,1.4*67")
    (folder / "GPSRaw.dat").write_text("\r\n".join(log))
    return folder


def test_the_rows_of_the_table_belong_to_the_epochs_of_the_log(tmp_path):
    dataset = loaded("beijing_car", beijing_files(tmp_path))
    recording = dataset.load(0)
    np.testing.assert_allclose(recording.velocity.mps[3], [10.3, 20.3, 0.0])
    np.testing.assert_allclose(recording.position.covariance_m2[0], np.diag([0.7**2, 0.5**2, 1.4**2]))
    np.testing.assert_allclose(recording.position.enu_m[2], [2.0, 4.0, 0.0])
    np.testing.assert_allclose(recording.reference.enu_m[2], [1.5, 4.25, 0.0])
    check_plugin("dataset", dataset)
    with pytest.raises(RecordingError, match=r"6 rows, .* 5 epochs"):
        loaded("beijing_car", beijing_files(tmp_path, 5)).load(0)
    (tmp_path / "GPSRaw.dat").write_text("$PSAT,FVI,030000,1\n$GPGST,030000,2,1,1,73,.5,.7,1.4*67")
    with pytest.raises(RecordingError, match="line 1 has 4 fields"):
        loaded("beijing_car", tmp_path).load(0)


def test_a_reference_of_rtklib_counts_where_its_quality_is_good(tmp_path):
    header = (
        "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    )
    for name, shift, quality in (("ublox_single_elev_10.pos", 1e-5, "555555"), ("r10.pos", 0.0, "115251")):
        rows = [
            f"2020/05/12 11:06:4{k}.000 {53.5 + shift} 10.0 50.0 {q} 9 1 2 3 0 0 0 0 0" for k, q in enumerate(quality)
        ]
        (tmp_path / name).write_text("\n".join([header, *rows]))
    recording = loaded("hamburg", tmp_path).load(0)
    assert recording.imu is None
    np.testing.assert_array_equal(recording.reference.t_s, [0, 1, 3, 5])
    np.testing.assert_allclose(recording.position.enu_m, 0, atol=1e-9)
    north_m = 1e-5 * np.radians(1) * 6.38e6
    np.testing.assert_allclose(recording.reference.enu_m[:, 1], -north_m, rtol=0.01)
