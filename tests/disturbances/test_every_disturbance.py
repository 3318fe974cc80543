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
NEED_ATTITUDE = ("lever_arm",)  # which a reference of withheld fixes has not
IMU_OR_STAMPS = ("imu_bias", "imu_vibration", "dropout", "jitter")
CORRELATED = ("rtk_float", "rtk_float_overconfident", "replayed_gnss", "coloured")  # each has a test of its own
OUTAGE = {"windows_s": ((15.0, 25.0),)}


@pytest.fixture
def recording(make):
    """With an attitude in its reference, as a simulation has."""
    plain = make().reference
    return make(reference=dataclasses.replace(plain, euler_rad=np.full((len(plain.t_s), 3), 0.1)))


def create(name, **parameters):
    return plugins.create("disturbance", {"name": name, **parameters})


def changed(one, other):
    """Names of the recording's parts that differ."""
    names = [f.name for f in dataclasses.fields(one)]
    return {name for name in names if pickle.dumps(getattr(one, name)) != pickle.dumps(getattr(other, name))}


@pytest.mark.parametrize("name", NAMES)
def test_the_input_stays_and_the_same_seed_gives_the_same(recording, name):
    disturbance = create(name)
    before = pickle.dumps(recording)
    first, again = disturbance.apply(recording, 3), disturbance.apply(recording, 3)
    assert pickle.dumps(recording) == before
    assert pickle.dumps(first) == pickle.dumps(again)
    assert (pickle.dumps(disturbance.apply(recording, 4)) != pickle.dumps(first)) == (
        disturbance.seeded or disturbance.replicates() > 1
    )


@pytest.mark.parametrize("name", sorted(set(NAMES) - {"none"}))
def test_it_does_something_to_the_defaults_recording(recording, name):
    done = create(name).apply(recording, 0)
    assert changed(done, recording)
    of_reference = name in ("withhold", "score_moving")  # they say where errors count
    assert of_reference or pickle.dumps(done.reference) == pickle.dumps(recording.reference)


@pytest.mark.parametrize("name", NAMES)
def test_seeds_beyond_the_replicates_repeat(recording, name):
    disturbance = create(name)
    n = disturbance.replicates()
    if not disturbance.seeded:
        results = [pickle.dumps(disturbance.apply(recording, seed)) for seed in range(2 * n)]
        assert len(set(results)) == n
        assert results[:n] == results[n:]


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(sorted(set(NAMES) - set(NEED_ATTITUDE))),
    st.integers(0, 2**31),
    st.permutations(["own", "withhold", "gnss_outage"]),
)
def test_it_composes_with_withhold_and_an_outage_in_any_order(make, name, seed, order):
    recording = make()
    parts = {"own": create(name), "withhold": create("withhold"), "gnss_outage": create("gnss_outage", **OUTAGE)}
    done = recording
    for part in order:
        done = parts[part].apply(done, seed)
    assert [15.0, 25.0] in done.outages_s.tolist()
    assert done.reference.source.startswith("fixes of the same receiver")
    if name != "jitter":  # its stamps may leave the window again
        assert not ((done.position.t_s >= 15) & (done.position.t_s < 25)).any()
    if order[0] == "withhold" and name not in ("withhold", "decimate_position", "jitter"):
        assert ((done.reference.t_s >= 15) & (done.reference.t_s < 25)).sum() == 30


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(SEEDED), st.integers(0, 2**31), st.integers(0, 2**31))
def test_seeds_and_labels_decide_what_is_drawn(make, name, one, other):
    recording = make(duration_s=100.0)
    first, second = (create(name).apply(recording, seed) for seed in (one, other))
    assert bool(changed(first, second)) == (one != other)
    assert changed(first, create(name, stream="second").apply(recording, one))


@pytest.mark.parametrize("name", NAMES)
def test_a_recording_without_gnss_is_taken_or_refused_by_its_name(make, name):
    bare = make(position=None, velocity=None, heading=None)
    try:
        plugins.create("disturbance", {"name": name}).apply(bare, 0)
    except RecordingError as error:
        assert str(error).startswith("made has n")  # noqa: PT017 - either is right, but not another sentence


def test_none_is_the_identity(recording):
    assert create("none").apply(recording, 0) is recording


@pytest.mark.parametrize("name", [n for n in SEEDED if n not in (*IMU_OR_STAMPS, *CORRELATED)])
def test_true_covariances_hold_what_was_added(make, name):
    """Over many rows the added error, normalised with what the true covariance grew by, has a mean square of one."""
    recording = make(duration_s=1000.0)
    done = create(name).apply(recording, 0)
    for before, after, values, true in (
        (recording.position, done.position, "enu_m", "true_covariance_m2"),
        (recording.velocity, done.velocity, "mps", "true_covariance_m2ps2"),
    ):
        if after is before or (name == "false_return" and true == "true_covariance_m2ps2"):  # it only drops velocities
            continue
        kept = np.isin(before.t_s, after.t_s)
        error = getattr(after, values) - getattr(before, values)[kept]
        growth = getattr(after, true) - getattr(before, true.removeprefix("true_"))[kept]
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
    "false_fix": [{"offset_m": -1.0}, {"windows_s": ((1.0, 5.0), (4.0, 8.0))}],
    "gnss_outage": [
        *({"windows_s": (one,)} for one in ((50.0, 40.0), (5.0, 5.0), (1.0, NAN), (1.0, 2.0, 3.0))),
        *({"count": 2, "length_s": 50.0}, {"count": 1, "length_s": 0.0}, {"count": -1}),
    ],
    "heavy_tailed": [{"probability": -0.1}, {"factor": 0.5}],
    "imu_bias": [{"gyro_radps": -1.0}],
    "imu_vibration": [{"accel_mps2": -1.0}, {"gyro_radps": NAN}, {"lowest_hz": 40.0}],
    "jitter": [{"imu_s": -0.1}, {"measurement_s": float("inf")}],
    "latency": [{"position_s": -0.1}],
    "lever_arm": [{"up_m": NAN}],
    "multipath_single_axis": [
        *({"bursts": -1}, {"shortest_s": 7.0}, {"shortest_s": 0.0}, {"smallest_m": 3.0}, {"smallest_m": -1.0}),
        *({"size_m": -1.0}, {"length_s": 0.0}),
    ],
    "noise_sine": [{"largest": 0.9}, {"period_s": 0.0}],
    "noise_step": [{"factor": 0.5}, {"times_s": (NAN,)}],
    "outage_sweep": [
        *({"length_s": 60.0}, {"length_s": 0.0}, {"phases": 0}, {"phase": 6}, {"phase": -1}, {"every_s": 5.0}),
    ],
    "outliers": [{"probability": 2.0}, {"smallest_m": 30.0}, {"size_m": float("inf")}],
    "rtk_float": [
        *({"factor": -1.0}, {"windows_s": ((5.0, 4.0),)}, {"time_s": 0.0}),
        *({"sigma_m": (1.0, 1.0)}, {"sigma_m": (1.0, 1.0, -1.0)}),
    ],
    "stated_covariance": [{"position_factor": 0.0}],
    "wheel_slip": [{"count": -1}, {"windows_s": ((4.0, 2.0),)}, {"slip": NAN}],
    "withhold": [{"every": 1}, {"every": 3, "phase": 3}],
}


@pytest.mark.parametrize(("name", "wrong"), [(name, one) for name, each in WRONG.items() for one in each])
def test_parameters_that_make_no_sense_are_refused_in_a_sentence(name, wrong):
    with pytest.raises(PluginError, match=r"\d.* .*\.$|nan.*\.$"):
        create(name, **wrong)
