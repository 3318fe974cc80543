import itertools
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from commands import verb
from jerkbench.datasets.random_drive import RandomDrive
from jerkbench.errors import PluginError
from jerkbench.jobs.rows import simulated
from jerkbench.plugins import create
from jerkbench.presets import preset

SEEDS = 2500
LAWS = {
    "roughness": stats.lognorm(0.4, scale=1.5),
    "vibration_mps2": stats.lognorm(0.7, scale=0.3),
    "speed_mps": stats.uniform(0.9, 1.3),
    "pass_s": stats.uniform(14, 16),
    "heading_rad": stats.uniform(-np.pi, 2 * np.pi),
    "outliers.size_m": stats.loguniform(0.5, 10),
    "multipath_single_axis.size_m": stats.loguniform(0.1, 2),
    "noise_step.factor": stats.loguniform(1.5, 8),
    "imu_bias.accel_mps2": stats.loguniform(0.02, 0.3),
    "imu_bias.gyro_radps": stats.loguniform(0.02 / 40, 0.3 / 40),
    "imu_vibration.accel_mps2": stats.loguniform(0.5, 8),
    "heavy_tailed.factor": stats.loguniform(3, 30),
    "false_fix.offset_m": stats.loguniform(0.1, 2),
    "rtk_float_overconfident.factor": stats.loguniform(0.2, 5),
    "stated_covariance.position_factor": stats.loguniform(0.04, 0.5),
    "wheel_slip.slip": stats.loguniform(0.05, 0.5),
    "ruts.rut_drop_m": stats.loguniform(0.02, 0.1),
}
"""The laws of the audit's plan, written anew."""
WINDOWS = {"gnss_outage": (2, 10), "false_fix": (5, 12), "rtk_float_overconfident": (10, 30), "wheel_slip": (3, 8)}


def mixture():
    """The preset, as a data set."""
    return create("dataset", preset("dataset", "mixture"))


@pytest.fixture(scope="module")
def drawn():
    """What each seed draws."""
    drives = mixture()
    return [drives.drawn(seed) for seed in range(SEEDS)]


@pytest.fixture(scope="module")
def values(drawn):
    """The values of each parameter, those of faults under the fault's name."""
    flat = {}
    for _, drive, faults in drawn:
        for name, value in drive.items():
            flat.setdefault(name, []).append(value)
        for kind, own in faults.items():
            for name, value in own.items():
                flat.setdefault(f"{kind}.{name}", []).append(value)
    return flat


@pytest.mark.parametrize("name", LAWS)
def test_parameters_follow_the_laws_of_the_plan(values, name):
    assert stats.kstest(values[name], LAWS[name].cdf).pvalue > 0.1 / len(LAWS)


@pytest.mark.parametrize("kind", WINDOWS)
def test_windows_have_the_lengths_of_the_plan(values, kind):
    lengths = [end - begin for windows in values[f"{kind}.windows_s"] for begin, end in windows]
    shortest, longest = WINDOWS[kind]
    most = max(map(len, values[f"{kind}.windows_s"]))

    assert stats.kstest(lengths, stats.uniform(shortest, longest - shortest).cdf).pvalue > 0.01
    assert most == (2 if kind == "rtk_float_overconfident" else 3)


def test_faults_have_the_stated_shares_and_parameters_are_independent(drawn):
    numbers = np.bincount([len(faults) for _, _, faults in drawn])
    kinds = pd.Series([kind for _, _, faults in drawn for kind in faults]).value_counts()
    white = sum(base == "field_white" for base, _, _ in drawn)
    assert stats.chisquare(numbers, SEEDS * np.array([0.2, 0.4, 0.25, 0.15])).pvalue > 0.01
    assert len(kinds) == 13
    assert stats.chisquare(kinds).pvalue > 0.01
    assert stats.binomtest(white, SEEDS).pvalue > 0.01
    table = pd.DataFrame([{**drive, "faults": len(faults), "white": len(base)} for base, drive, faults in drawn])
    pairs = list(itertools.combinations(table, 2))
    least = min(stats.spearmanr(table[one], table[other]).pvalue for one, other in pairs)
    assert least > 0.01 / len(pairs)


def arrays(recording):
    """All that filters see, and what they are compared with."""
    position, velocity = recording.position, recording.velocity
    return [
        *(recording.imu.accel_mps2, recording.imu.gyro_radps, recording.reference.enu_m, recording.outages_s),
        *(position.t_s, position.enu_m, position.covariance_m2, velocity.mps, velocity.covariance_m2ps2),
    ]


def content(seed):
    """The bytes of a drive; in any process."""
    return [array.tobytes() for array in arrays(mixture().load(seed))]


def test_a_drive_depends_on_its_seed_alone_whoever_draws_it_and_when():
    seeds = [5, 6, 1]
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        elsewhere = list(pool.map(content, seeds))
    here = {seed: content(seed) for seed in reversed(seeds)}

    assert elsewhere == [here[seed] for seed in seeds]
    assert here[5] != here[6]


@pytest.mark.parametrize("seed", [1, 6])
def test_a_drive_is_what_its_parts_give_with_the_drawn_parameters(seed):
    base, drive, faults = mixture().drawn(seed)
    ruts = {"ruts": True, **faults.pop("ruts")} if "ruts" in faults else {}
    recording = create("dataset", {"name": base, **drive, **ruts}).load(seed)
    for kind, own in faults.items():
        recording = create("disturbance", {"name": kind, **own}).apply(recording, seed)

    for ours, theirs in zip(arrays(mixture().load(seed)), arrays(recording), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_the_law_of_the_errors_goes_with_a_fault_and_what_was_drawn_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    whole = mixture()
    calm = replace(whole, fault_shares=(1.0,))

    for recording in (simulated(whole, 6), simulated(whole, 6)):  # drawn, and read again
        assert recording.drawn is None
        assert recording.parameters["drawn.ruts.rut_drop_m"] == whole.drawn(6)[2]["ruts"]["rut_drop_m"]
    assert calm.load(6).drawn is not None
    assert calm.load(6).parameters["drawn.faults"] == 0.0


def test_a_study_sweeps_over_drives_and_each_row_says_which(tmp_path):
    words = ["dataset=mixture", 'dataset.drive=["duration_s ~ always 160"]', "seeds=2", "study=drives"]
    done = verb("run", "-m", *words, "adaptation=none,fuzzy", "filter=baseline", "workers=2", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = pd.read_csv(tmp_path / "results" / "drives" / "rows.csv")
    dataset = replace(mixture(), drive=("duration_s ~ always 160",))

    assert len(rows) == 4
    assert set(rows["status"]) == {"ok"}
    assert "drawn" not in done.stdout
    for _, row in rows.iterrows():
        base, drive, faults = dataset.drawn(row["seed"])
        columns = {name for name in rows if name.startswith("drawn.fault.") and row[name] == 1}
        assert columns == {f"drawn.fault.{kind}" for kind in faults}
        assert row[f"drawn.base.{base}"] == 1
        assert (row["drawn.faults"], row["drawn.duration_s"]) == (len(faults), drive["duration_s"])


@pytest.mark.parametrize(
    ("parameters", "word"),
    [
        ({"bases": ("rtklib",)}, "rtklib"),
        ({"bases": ()}, "bases|data set"),
        ({"drive": ("speed ~ always 1",)}, "speed_mps"),
        ({"faults": (("outlier",),)}, "outliers"),
        ({"faults": (("outliers", "size ~ always 1"),)}, "size_m"),
        ({"fault_shares": (0.5, 0.4)}, "fault_shares"),
        ({"fault_shares": (0.5, 0.5)}, "fault_shares"),
    ],
)
def test_a_wrong_name_or_share_is_a_sentence(parameters, word):
    with pytest.raises(PluginError, match=word):
        RandomDrive(**parameters)
