"""A journey of three small files: what is read, what is taken where nothing is stated, what is refused."""

import json

import numpy as np
import pandas as pd
import pytest

from jerkbench import plugins
from jerkbench.datasets.journey import _POSITION, _SIGMA, _VELOCITY, RecordedFixes
from jerkbench.disturbances.outages import ScoreMoving
from jerkbench.errors import PluginError, RecordingError
from jerkbench.testing import check_plugin

META = {
    "group": "ppc",
    "name": "nagoya_run1",
    "receiver": "UWB, 4 anchors",
    "reference": "RTK",
    "independent": True,
    "origin": [35.0, 136.9, 41.0],
    "t0_s": 7.0,
}


@pytest.fixture
def folder(tmp_path):
    """Fixes at 1 Hz from 10 s on, the third stamp twice; a reference at 10 Hz that moves 1 m/s east from 13 s on."""
    t_s = np.array([10.0, 11.0, 12.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0])
    fixes = pd.DataFrame(dict(zip(("t_s", *_POSITION), (t_s, t_s - 9.0, t_s * 2.0, t_s * 0.0), strict=True)))
    fixes.to_parquet(tmp_path / "fixes.parquet")
    truth_s = np.arange(95, 200) / 10.0
    truth = pd.DataFrame({"t_s": truth_s, "e_m": np.maximum(truth_s - 13.0, 0.0), "n_m": 0.0, "u_m": 1.0})
    truth.to_parquet(tmp_path / "reference.parquet")
    (tmp_path / "meta.json").write_text(json.dumps(META))
    return tmp_path


def changed(folder, **meta):
    (folder / "meta.json").write_text(json.dumps({**META, **meta}))
    return RecordedFixes(str(folder)).load()


def test_a_journey_is_fixes_and_a_reference_on_the_clock_of_the_first_fix(folder):
    recording = RecordedFixes(str(folder)).load()
    assert recording.name == "ppc/nagoya_run1"
    assert recording.imu is None
    assert recording.velocity is None
    assert recording.origin.latitude_deg == 35.0
    np.testing.assert_allclose(recording.position.t_s, np.arange(10.0))  # the repeated stamp is left out
    np.testing.assert_allclose(recording.position.enu_m[:3, 0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(recording.reference.t_s[0], -0.5)
    assert recording.reference.independent
    assert recording.reference.source == "RTK"
    check_plugin("dataset", plugins.create("dataset", {"name": "journey", "folder": str(folder)}))


@pytest.mark.parametrize(
    ("receiver", "sigma_m"), [("UWB, 4 anchors", 0.3), ("Google Pixel 6", 5.0), ("xiaomi, code", 5.0), ("u-blox", 3.0)]
)
def test_a_sigma_that_is_not_stated_is_taken_by_the_receiver_and_told(folder, receiver, sigma_m):
    recording = changed(folder, receiver=receiver)
    np.testing.assert_allclose(recording.position.covariance_m2[4], sigma_m**2 * np.eye(3))
    assert f"The fixes have no sigma; {sigma_m:g} m per axis are used." in recording.notes
    given = RecordedFixes(str(folder), position_sigma_m=2.0).load()
    np.testing.assert_allclose(given.position.covariance_m2[0], 4.0 * np.eye(3))


def test_sigmas_and_velocities_that_are_stated_are_used(folder):
    fixes = pd.read_parquet(folder / "fixes.parquet")
    fixes[_SIGMA], fixes[_VELOCITY] = [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]
    fixes.to_parquet(folder / "fixes.parquet")
    recording = RecordedFixes(str(folder), position_sigma_m=9.0, velocity_sigma_mps=0.5).load()
    np.testing.assert_allclose(recording.position.covariance_m2[2], np.diag([1.0, 4.0, 9.0]))
    np.testing.assert_allclose(recording.velocity.mps[7], [4.0, 5.0, 6.0])
    np.testing.assert_allclose(recording.velocity.covariance_m2ps2[7], 0.25 * np.eye(3))
    assert "sigma" not in " ".join(recording.notes)


def test_the_clock_of_the_fixes_is_shifted_and_told(folder):
    recording = changed(folder, clock_shift_s=-0.25)
    np.testing.assert_allclose(recording.position.t_s[:2], [-0.25, 0.75])
    np.testing.assert_allclose(recording.reference.t_s[0], -0.5)
    assert "The stamps of the fixes are shifted by -0.25 s." in recording.notes
    np.testing.assert_allclose(RecordedFixes(str(folder), clock_shift_s=0.0).load().position.t_s[0], 0.0)


def test_what_is_wrong_is_one_sentence(folder):
    with pytest.raises(PluginError, match="clock_shift_s is nan"):
        RecordedFixes(str(folder), clock_shift_s=np.nan)
    with pytest.raises(RecordingError, match="There is no folder"):
        RecordedFixes(str(folder / "none")).load()
    (folder / "meta.json").write_text("[1]")
    with pytest.raises(RecordingError, match="does not contain a JSON object"):
        RecordedFixes(str(folder)).load()
    (folder / "meta.json").write_text("{")
    with pytest.raises(RecordingError, match="is not valid JSON"):
        RecordedFixes(str(folder)).load()
    (folder / "meta.json").write_text("{}")
    assert RecordedFixes(str(folder)).load().name == folder.name
    pd.read_parquet(folder / "fixes.parquet").drop(columns="t_s").to_parquet(folder / "fixes.parquet")
    with pytest.raises(RecordingError, match=r"fixes.parquet: There is no column"):
        RecordedFixes(str(folder)).load()
    with pytest.raises(PluginError, match="rate_hz is 0"):
        ScoreMoving(rate_hz=0.0)


def test_errors_count_once_a_second_while_it_moves_near_fixes_and_outside_of_gaps(folder):
    recording = ScoreMoving().apply(RecordedFixes(str(folder)).load(), 0)
    np.testing.assert_allclose(recording.reference.t_s[recording.reference.scored], [3.1, 4, 5, 6, 7, 8, 9])
    five = ScoreMoving(rate_hz=5.0).apply(RecordedFixes(str(folder)).load(), 0).reference
    np.testing.assert_allclose(np.diff(five.t_s[five.scored])[1:], 0.2)
    assert ScoreMoving(slowest_mps=1.5).apply(RecordedFixes(str(folder)).load(), 0).reference.scored.sum() == 0
    near = ScoreMoving(rate_hz=10.0, fix_s=0.15).apply(RecordedFixes(str(folder)).load(), 0).reference
    around = (np.arange(3.0, 10.0)[:, None] + [-0.1, 0.0, 0.1]).ravel()
    np.testing.assert_allclose(near.t_s[near.scored], around[2:])
    truth = pd.read_parquet(folder / "reference.parquet")
    truth[(truth.t_s < 15.0) | (truth.t_s > 17.0)].to_parquet(folder / "reference.parquet")
    scored = ScoreMoving().apply(RecordedFixes(str(folder)).load(), 0).reference
    np.testing.assert_allclose(scored.t_s[scored.scored], [3.1, 4.0, 7.7, 8.0, 9.0])


def test_the_journeys_that_are_here(shared_folder):
    """Errors of the fixes, with the stamps of the reference, as measured by a script of a few lines."""
    known = {"ppc/nagoya_run2": 4.79, "taroz/nagoya_20240720": 9.84, "thi_phone/20230414_1": 6.14}
    for name, rms_m in known.items():
        folder = shared_folder / "data" / "journeys" / name
        if not folder.is_dir():
            pytest.skip("the journeys are not in ../shared/data")
        recording = RecordedFixes(str(folder)).load()
        position, reference = recording.position, recording.reference
        at = np.searchsorted(reference.t_s, position.t_s).clip(1, len(reference.t_s) - 1)
        near = np.minimum(abs(reference.t_s[at] - position.t_s), abs(reference.t_s[at - 1] - position.t_s)) < 0.25
        truth = np.column_stack([np.interp(position.t_s, reference.t_s, axis) for axis in reference.enu_m.T[:2]])
        error = np.linalg.norm(position.enu_m[:, :2] - truth, axis=1)[near]
        assert np.sqrt(np.mean(error**2)) == pytest.approx(rms_m, abs=0.01)
