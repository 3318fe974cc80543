"""The smoothed track of fixes alone: its noises are found again, wild fixes do not bend it, and GPX brings it back."""

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_t

from commands import verb
from jerkbench.errors import RecordingError
from jerkbench.estimate import Updates
from jerkbench.inspection.smoothing import smooth_fixes, surprises
from jerkbench.io.tracks import read_gpx
from jerkbench.io.writing import write_gpx
from jerkbench.recording import Origin, Position, Recording, Reference

SIGMA_M, WALK = 0.5, 1.5


def driven(fixes=400, stated=1.0, wild=()):
    """A car whose velocity is a random walk of ``WALK``, 1 Hz, and fixes that state ``stated`` times their sigma."""
    draw = np.random.default_rng(3)
    fine_s, step_s = np.arange(0.0, fixes, 0.01), 0.01
    velocity = np.cumsum(WALK * np.sqrt(step_s) * draw.normal(size=(len(fine_s), 3)), axis=0)
    true_m = np.cumsum(velocity * step_s, axis=0)[::100]
    fixes_m = true_m + SIGMA_M * draw.normal(size=true_m.shape)
    fixes_m[list(wild)] += [60.0, -40.0, 80.0]
    t_s, covariance = fine_s[::100], np.tile((stated * SIGMA_M) ** 2 * np.eye(3), (fixes, 1, 1))
    truth = Reference(t_s, "a random walk", independent=True, enu_m=true_m)
    start = datetime(2024, 5, 14, 14, tzinfo=UTC)
    return Recording(
        "walk", None, truth, Position(t_s, fixes_m, covariance), origin=Origin(48.0, 11.0, 500.0), start_utc=start
    )


def test_the_surprise_is_that_of_students_t():
    draw = np.random.default_rng(1)
    half = draw.normal(size=(3, 3))
    S, y = half @ half.T + np.eye(3), draw.normal(size=3)
    updates = replace(
        Updates.empty(),
        t_s=np.zeros(1),
        rows=np.array([3.0]),
        nis=np.array([y @ np.linalg.solve(S, y)]),
        log_det=np.array([np.linalg.slogdet(S)[1]]),
    )

    assert surprises(updates, 4.0)[0] == pytest.approx(-multivariate_t(shape=S, df=4.0).logpdf(y), rel=1e-12)


@pytest.mark.parametrize("stated", [0.1, 1.0, 10.0])
def test_the_noises_are_found_again(stated):
    track = smooth_fixes(driven(stated=stated))

    assert track.sigma_scale * stated == pytest.approx(1.0, rel=0.15)
    assert track.freedom > 100.0
    assert track.smoother.model in ("constant_velocity", "constant_turn")
    assert track.smoother.velocity_walk_mps_per_sqrt_s == pytest.approx(WALK, rel=0.3)


def test_the_track_is_better_than_the_fixes_and_wild_fixes_do_not_bend_it():
    fixes_m, track_m = smooth_fixes(driven()).error_m
    wild = smooth_fixes(driven(wild=range(50, 400, 50)))

    assert track_m < 0.8 * fixes_m
    assert wild.error_m[1] < min(2.0 * track_m, 0.1 * wild.error_m[0])
    assert wild.distance_m.max() > 100.0


def test_its_own_fixes_are_no_truth_and_few_fixes_are_no_track():
    recording = driven(60)
    own = replace(recording, reference=replace(recording.reference, enu_m=recording.position.enu_m))

    assert smooth_fixes(own).error_m is None
    with pytest.raises(RecordingError, match="fewer than 10 fixes"):
        smooth_fixes(driven(5))


def test_a_gpx_brings_places_and_times_back(tmp_path):
    recording = driven(60)
    write_gpx(recording, tmp_path / "a.gpx")
    table, notes = read_gpx(tmp_path / "a.gpx")
    stamps_s = (table["t"] - pd.Timestamp("2024-05-14T14:00:00Z")).dt.total_seconds()

    assert notes == ()
    np.testing.assert_allclose(stamps_s, recording.reference.t_s, atol=1e-6)
    north_m = np.radians(table["latitude"] - 48.0) * 6_366_900.0  # the meridian's radius there
    np.testing.assert_allclose(north_m, recording.reference.enu_m[:, 1], rtol=1e-3, atol=0.05)
    write_gpx(replace(recording, start_utc=None), tmp_path / "b.gpx")
    assert "<time>" not in (tmp_path / "b.gpx").read_text()
    with pytest.raises(RecordingError, match="no origin"):
        write_gpx(replace(recording, origin=None), tmp_path / "c.gpx")


JOURNEYS = ("taroz/nagoya_20240720", "ppc/nagoya_run2")


@pytest.mark.slow
@pytest.mark.parametrize("name", JOURNEYS)
def test_the_track_of_a_real_journey_is_read_again_and_beats_its_fixes(name, shared_folder, tmp_path):
    folder = shared_folder / "data" / "journeys" / name
    latitude, longitude, height = json.loads((folder / "meta.json").read_text())["origin"]
    for file in ("fixes", "reference"):
        table = pd.read_parquet(folder / f"{file}.parquet")
        table = table[table["t_s"] < table["t_s"].iloc[0] + 300.0]
        table = table[table["t_s"].diff().fillna(1.0) > 0]
        table.assign(t_s=table["t_s"] + 1.7e9).to_csv(tmp_path / f"{file}.csv", index=False)
    (tmp_path / "dataset").mkdir()
    columns = "[e_m, n_m, u_m]"
    preset = {
        "defaults": "[table, _self_]",
        "folder": f'"{tmp_path}"',
        "imu_file": '""',
        "drop_leaps": "false",
        "origin": f"[{latitude}, {longitude}, {height}]",
        "position_file": "fixes.csv",
        "position_time": "t_s",
        "position_frame": "enu",
        "position_columns": columns,
        "reference_file": "reference.csv",
        "reference_time": "t_s",
        "reference_position": columns,
    }
    lines = [f"{key}: {value}" for key, value in preset.items()]
    (tmp_path / "dataset" / "ride.yaml").write_text("\n".join(lines) + "\n")

    done = verb("smooth", "ride", "--config-dir", ".", "--to", "track.gpx", "--figure", "track.png", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    track, _ = read_gpx(tmp_path / "track.gpx")
    truth = pd.read_csv(tmp_path / "reference.csv")
    fixes = pd.read_csv(tmp_path / "fixes.csv")

    def rmse(t_s, enu_m):
        near = np.abs(t_s[:, None] - truth["t_s"].to_numpy()[None, :]).min(axis=1) < 0.25
        true_m = np.column_stack([np.interp(t_s, truth["t_s"], truth[axis]) for axis in ("e_m", "n_m", "u_m")])
        return float(np.sqrt(np.mean(np.sum((enu_m - true_m)[near] ** 2, axis=1))))

    from pymap3d import geodetic2enu

    back_m = np.column_stack(
        geodetic2enu(track["latitude"], track["longitude"], track["height"], latitude, longitude, height)
    )
    seconds = track["t"].astype("int64").to_numpy() / 10 ** (9 if track["t"].dt.unit == "ns" else 6)
    raw_m = rmse(fixes["t_s"].to_numpy(), fixes[["e_m", "n_m", "u_m"]].to_numpy())
    smooth_m = rmse(seconds, back_m)
    assert len(track) == len(fixes)
    assert smooth_m < raw_m, (smooth_m, raw_m)
    assert (tmp_path / "track.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--to", "track.gxp"], "Did you mean '.gpx'"),
        (["--figure", "track.jpg"], "suffix of a figure"),
        (["--set", "duration_s=3", "--to", "a.gpx"], "Did you mean"),
    ],
)
def test_wrong_words_are_a_sentence(tmp_path, words, sentence):
    done = verb("smooth", "field_whit" if "--set" in words else "field_white", *words, cwd=tmp_path)

    assert (done.returncode, sentence in done.stderr) == (2, True), done.stderr


def test_an_ending_alone_names_the_file_after_the_log(tmp_path):
    done = verb("smooth", "field_white", "--set", "duration_s=20", "--to", "tum", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert "Track: field_white_smooth.tum" in done.stdout
    assert (tmp_path / "field_white_smooth.tum").is_file()


def test_a_track_starts_with_the_first_fix_that_has_a_height():
    recording = driven(fixes=60)
    enu_m = recording.position.enu_m.copy()
    enu_m[[0, 1, 30], 2] = np.nan
    late = replace(recording, position=replace(recording.position, enu_m=enu_m))

    track = smooth_fixes(late)
    np.testing.assert_array_equal(track.recording.reference.t_s, recording.position.t_s[2:])
    assert np.isfinite(track.recording.reference.enu_m).all()
