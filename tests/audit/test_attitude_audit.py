"""The audit of attitude filters: leaving out, the test's correction, equal tuning, and rows that are kept."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jerkbench.attitude.mekf import Mekf
from jerkbench.audit import tilt_trials as rows_module
from jerkbench.audit.tilt_study import (
    TRIED_EACH,
    TUNINGS,
    attitude_answer,
    attitude_audit_page,
    holm,
    losses_left_out,
    settings_left_out,
    tilt_verdicts,
    tried,
)
from jerkbench.audit.tilt_trials import (
    AS_THEY_COME,
    TILT_METHODS,
    TILT_SETTINGS,
    all_trials,
    audit_rows,
    error_deg,
    kitti_pieces,
)

KEPT = Path(__file__).parents[2] / "experiments" / "attitude" / "errors.parquet"


def test_a_trial_does_not_choose_its_own_setting():
    """Setting 0 is the best on every trial but the last, where it is far worse: there it is taken all the same."""
    loss = np.ones((TILT_SETTINGS, 5))
    for subset in tried():
        loss[subset[0], :4], loss[subset[0], 4] = 0.0, 9.0
    taken = settings_left_out(loss)
    for r, subset in enumerate(tried()):
        assert taken[r, 4] in subset
        assert loss[taken[r, 4], 4] == 9.0
        assert loss[taken[r, 0], 4] == 1.0
    np.testing.assert_array_equal(losses_left_out(loss, taken)[:, 4], 9.0)


def test_every_method_is_tuned_with_the_same_numbers():
    assert {len(method.settings()) for method in TILT_METHODS.values()} == {TILT_SETTINGS}
    assert {len(subset) for subset in tried()} == {TRIED_EACH}
    assert len(tried()) == TUNINGS
    for method in TILT_METHODS.values():
        for switch in (*method.switches, "gravity"):
            assert sum(setting[switch] for setting in method.settings()) == TILT_SETTINGS / 2
        for name, bounds in method.ranges.items():
            shares = np.array([bounds.share(setting[name]) for setting in method.settings()])
            assert np.ptp(shares) > 0.9


@pytest.mark.parametrize("name", TILT_METHODS)
def test_a_setting_makes_its_plugin(name):
    """Each value of a setting changes the plugin."""
    method = TILT_METHODS[name]
    setting = dict(method.settings()[0])
    setting |= dict.fromkeys((*method.switches, "gravity"), 1.0)
    plugin = method.plugin(setting, 100.0)
    for key in setting:
        other = method.ranges[key].value(0.987) if key in method.ranges else 0.0
        assert method.plugin(setting | {key: other}, 100.0) != plugin, key
    assert method.plugin(setting, 100.0, "track").alignment == "track"


def test_holm_is_what_the_paper_says():
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.9]) == [1.0, 1.0]


def test_a_method_that_is_always_better_is_found():
    n = np.random.default_rng(0).normal(size=(TUNINGS, 20))
    losses = {"constant": n, "vqf": n - 0.2, "mekf": n + 0.01 * n[::-1]}
    found = tilt_verdicts(losses, "constant")
    assert found["vqf"].mean[0] == pytest.approx(np.exp(-0.2))
    assert (found["vqf"].wins, found["vqf"].n, found["vqf"].word) == (20, 20, "better")
    assert found["vqf"].p == pytest.approx(2 * 2 * 0.5**20)
    assert found["mekf"].word == "undecided"


def test_a_piece_ends_where_samples_are_missing(tmp_path):
    t = np.concatenate([np.arange(0, 8, 0.01), np.arange(9, 12, 0.01), np.arange(13, 20, 0.01)])
    names = ["ax", "ay", "az", "gx", "gy", "gz", "e", "n", "u", "ve", "vn", "vu", "roll", "pitch", "yaw"]
    drive = pd.DataFrame(0.0, index=range(len(t)), columns=names).assign(t=t, az=9.81)
    drive.loc[t > 3.0, "ve"] = 5.0
    drive.to_parquet(tmp_path / "a_drive.parquet")
    pieces = kitti_pieces(tmp_path / "a_drive.parquet", 0)
    assert [len(piece[1]) for piece in pieces] == [800, 700]
    assert [piece[0].static_start_s for piece in pieces] == [pytest.approx(3.01), 0.0]
    assert error_deg(Mekf(), pieces) < 1e-6


def test_a_known_start_is_that_of_the_track_and_what_it_took_does_not_count(tmp_path):
    """Twenty seconds of a steady acceleration from 3 m/s: level or gravity start 5.8 degrees off."""
    t = np.arange(2000) / 100
    names = ["gx", "gy", "gz", "e", "n", "u", "vn", "vu", "roll", "pitch", "yaw", "ay"]
    drive = pd.DataFrame(0.0, index=range(2000), columns=names).assign(t=t, ax=1.0, az=9.81, ve=3.0 + t)
    (tmp_path / "kitti").mkdir()
    drive.to_parquet(tmp_path / "kitti" / "a_drive.parquet")
    drive[:1400].to_parquet(tmp_path / "kitti" / "short_drive.parquet")
    trials = [trial for trial in all_trials(tmp_path) if trial.domain.startswith("kitti")]
    assert [(trial.domain, trial.name) for trial in trials] == [
        ("kitti", "a_drive"),
        ("kitti", "short_drive"),
        ("kitti_start", "a_drive"),
    ]
    known = trials[-1]
    ((recording, truth, counted),) = known.pieces()
    np.testing.assert_array_equal(counted, recording.imu.t_s >= 10.0)
    setting = {"gain_per_s": 3e-4, "gravity": 1.0}
    of_gravity, of_track = (
        error_deg(TILT_METHODS["madgwick"].plugin(setting, 100.0, way), [(recording, truth, counted)])
        for way in ("", known.alignment)
    )
    assert of_gravity > 4.0
    assert of_track < 1.0


def test_what_is_not_there_is_left_out_and_said(tmp_path):
    assert {trial.domain for trial in all_trials(tmp_path)} == {"field"}
    kept = pd.read_parquet(KEPT)
    page = attitude_audit_page(kept[kept["domain"].isin(["broad", "field"])])
    assert "Not here, and left out: TStick, hand; KITTI, vehicle; KITTI, vehicle, start known." in page


def test_the_answer_is_that_of_the_verdicts():
    lines = attitude_answer(pd.read_parquet(KEPT)).splitlines()
    assert len(lines) == 5  # three sets of recordings, KITTI with known starts, the simulated field
    assert lines[0].startswith("- BROAD, hand (n = 20): Against constant vqf better; mekf_lee worse.")
    assert lines[2].endswith("Against vqf constant, mtf, mekf, mekf_mtf, mekf_lee, madgwick, mahony better.")


def test_rows_are_kept_trial_by_trial_and_taken_as_long_as_code_and_data_are_the_same(tmp_path, monkeypatch):
    for table, own in (("TILT_METHODS", TILT_METHODS), ("AS_THEY_COME", AS_THEY_COME)):
        monkeypatch.setattr(rows_module, table, {name: of for name, of in own.items() if "vqf" not in name})
    monkeypatch.setattr(rows_module, "version", lambda _: "of a package that need not be here")
    trials = list(all_trials(tmp_path))[:2]
    first = audit_rows(trials, tmp_path, 1, 1)
    monkeypatch.setattr(rows_module, "error_deg", lambda *_: 1e9)
    again = audit_rows(trials, tmp_path, 1, 1)
    monkeypatch.setattr(rows_module, "code_digest", lambda *_: "other code")
    other = audit_rows(trials, tmp_path, 1, 1)

    pd.testing.assert_frame_equal(first, again)
    assert len(first) == 2 * (len(TILT_METHODS) - 1 + len(AS_THEY_COME) - 2)
    assert list(first["trial"].unique()) == ["seed 00", "seed 01"]
    assert (other["inclination_rmse_deg"] == 1e9).all()
