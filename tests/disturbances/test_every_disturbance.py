import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jerkbench import plugins
from jerkbench.errors import PluginError, RecordingError

NAMES = [
    name
    for name in plugins.names("disturbance")
    if plugins.get("disturbance", name).__module__.startswith("jerkbench.")
]
SEEDED = [name for name in NAMES if plugins.get("disturbance", name).seeded]
NEED_ATTITUDE = ("lever_arm",)  # a reference of withheld fixes has no attitude
IMU_OR_STAMPS = ("imu_bias", "imu_vibration", "dropout", "jitter")
CORRELATED = ("rtk_float", "rtk_float_overconfident", "replayed_gnss", "coloured")  # each has a separate test


@pytest.fixture
def recording(make):
    """A recording whose reference has an attitude, as in a simulation."""
    plain = make().reference
    return make(reference=dataclasses.replace(plain, euler_rad=np.full((len(plain.t_s), 3), 0.1)))


def create(name, **parameters):
    return plugins.create("disturbance", {"name": name, **parameters})


def changed(one, other):
    """Names of the parts of the recording that differ."""
    names = [f.name for f in dataclasses.fields(one)]
    return {name for name in names if pickle.dumps(getattr(one, name)) != pickle.dumps(getattr(other, name))}


@pytest.mark.parametrize("name", NAMES)
def test_replicates_differ_only_none_changes_nothing_and_only_what_scores_changes_the_reference(recording, name):
    disturbance = create(name)
    replicates = {pickle.dumps(disturbance.apply(recording, seed)) for seed in range(disturbance.replicates())}
    assert len(replicates) == disturbance.replicates()
    disturbed = disturbance.apply(recording, 3)
    assert (disturbed is recording) == (not changed(disturbed, recording)) == (name == "none")
    scores = name in ("withhold", "score_moving")
    assert scores or pickle.dumps(disturbed.reference) == pickle.dumps(recording.reference)


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(sorted(set(NAMES) - set(NEED_ATTITUDE))),
    st.integers(0, 2**31),
    st.permutations(["tested", "withhold", "gnss_outage"]),
)
def test_it_composes_with_withhold_and_an_outage_in_any_order(make, name, seed, order):
    recording = make()
    parts = {
        "tested": create(name),
        "withhold": create("withhold"),
        "gnss_outage": create("gnss_outage", windows_s=((15.0, 25.0),)),
    }
    done = recording
    for part in order:
        done = parts[part].apply(done, seed)
    assert [15.0, 25.0] in done.outages_s.tolist()
    assert done.reference.source.startswith("fixes of the same receiver")
    if name != "jitter":  # its stamps may move out of the window
        assert not ((done.position.t_s >= 15) & (done.position.t_s < 25)).any()
    if order[0] == "withhold" and name not in ("withhold", "decimate_position", "jitter"):
        assert ((done.reference.t_s >= 15) & (done.reference.t_s < 25)).sum() == 30


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(SEEDED), st.integers(0, 2**31), st.integers(0, 2**31))
def test_seeds_and_labels_determine_the_random_numbers(make, name, one, other):
    recording = make(duration_s=100.0)
    first, second = (create(name).apply(recording, seed) for seed in (one, other))
    assert bool(changed(first, second)) == (one != other)
    assert changed(first, create(name, stream="second").apply(recording, one))


WITHOUT_GNSS = {"decimate_position", "gnss_outage", "outage_sweep", "latency", "none", "score_moving", *IMU_OR_STAMPS}


@pytest.mark.parametrize("name", NAMES)
def test_a_recording_without_gnss_raises_unless_it_is_not_needed(make, name):
    bare = make(position=None, velocity=None, heading=None)
    if name in WITHOUT_GNSS:
        create(name).apply(bare, 0)
    else:
        streams = "no position fixes|no velocity|neither position nor velocity"
        with pytest.raises(RecordingError, match=rf"made has ({streams}), so \w+ cannot be applied"):
            create(name).apply(bare, 0)


@pytest.mark.parametrize("name", [n for n in SEEDED if n not in (*IMU_OR_STAMPS, *CORRELATED)])
def test_true_covariances_include_the_added_errors(make, name):
    """The added error, normalised with the growth of the true covariance, has a mean square of one over many rows."""
    recording = make(duration_s=1000.0)
    done = create(name).apply(recording, 0)
    for before, after, values, true in (
        (recording.position, done.position, "enu_m", "true_covariance_m2"),
        (recording.velocity, done.velocity, "mps", "true_covariance_m2ps2"),
    ):
        if after is before or (name == "false_return" and true == "true_covariance_m2ps2"):  # it only drops velocities
            continue
        retained = np.isin(before.t_s, after.t_s)
        error = getattr(after, values) - getattr(before, values)[retained]
        growth = getattr(after, true) - getattr(before, true.removeprefix("true_"))[retained]
        hit = np.trace(growth, axis1=1, axis2=2) > 1e-12
        assert hit.any()
        np.testing.assert_allclose(error[~hit], 0, atol=1e-12)
        nees = np.einsum("mi,mij,mj->m", error[hit], np.linalg.pinv(growth[hit], rcond=1e-9), error[hit])
        rank = np.linalg.matrix_rank(growth[hit][0], tol=1e-9)
        assert nees.mean() / rank == pytest.approx(1, abs=0.15)


NAN = float("nan")
WRONG = {
    "coloured": [{"position_share": 1.0}, {"velocity_time_s": 0.0}],
    "decimate_position": [{"every": 0}, {"every": 3, "phase": 3}, {"every": 3, "phase": -1}],
    "dropout": [{"probability": 1.1}, {"longest": 0}],
    "false_fix": [{"windows_s": ((1.0, 5.0), (4.0, 8.0))}],
    "gnss_outage": [
        *({"windows_s": (one,)} for one in ((50.0, 40.0), (5.0, 5.0), (1.0, NAN), (1.0, 2.0, 3.0))),
        *({"count": 2, "length_s": 50.0}, {"count": 1, "length_s": 0.0}),
    ],
    "heavy_tailed": [{"probability": -0.1}, {"factor": 0.5}],
    "imu_vibration": [{"lowest_hz": 40.0}],
    "jitter": [{"measurement_s": float("inf")}],
    "lever_arm": [{"up_m": NAN}],
    "multipath_single_axis": [{"shortest_s": 7.0}, {"shortest_s": 0.0}, {"smallest_m": 3.0}, {"length_s": 0.0}],
    "noise_sine": [{"largest": 0.9}, {"period_s": 0.0}],
    "noise_step": [{"factor": 0.5}, {"times_s": (NAN,)}],
    "outage_sweep": [{"length_s": 60.0}, {"length_s": 0.0}, {"phases": 0}, {"phase": 6}, {"every_s": 5.0}],
    "outliers": [{"probability": 2.0}, {"smallest_m": 30.0}, {"size_m": float("inf")}],
    "rtk_float": [{"windows_s": ((5.0, 4.0),)}, {"time_s": 0.0}, {"sigma_m": (1.0, 1.0)}, {"sigma_m": (1, 1, -1)}],
    "stated_covariance": [{"position_factor": 0.0}],
    "wheel_slip": [{"windows_s": ((4.0, 2.0),)}, {"slip": NAN}],
    "withhold": [{"every": 1}, {"every": 3, "phase": 3}],
}


@pytest.mark.parametrize(("name", "wrong"), [(name, one) for name, each in WRONG.items() for one in each])
def test_invalid_parameters_raise(name, wrong):
    with pytest.raises(PluginError, match=r"(\d|nan|inf).*\.$"):
        create(name, **wrong)
