import dataclasses

import numpy as np
import pytest

from jerkbench.disturbances.multipath import MultipathSingleAxis
from jerkbench.disturbances.outages import _SOURCE, DecimatePosition, GnssOutage, Withhold
from jerkbench.errors import RecordingError
from jerkbench.io.conversions import velocity_when_true
from jerkbench.recording import Reference, Velocity

LATENCY_S = (0.125, 0.125, 0.275)  # up is more than one epoch old at 4 Hz


def delayed(recording):
    """Each velocity component is the number of its epoch, so that a leak can be detected."""
    t_s = recording.position.t_s
    epoch = np.repeat(np.arange(len(t_s), dtype=float)[:, None], 3, axis=1)
    velocity = velocity_when_true(t_s, epoch, np.tile(np.eye(3), (len(t_s), 1, 1)), LATENCY_S)
    return dataclasses.replace(recording, velocity=velocity)


def epochs_in(velocity):
    return [sorted(velocity.mps[np.isfinite(velocity.mps[:, axis]), axis].tolist()) for axis in range(3)]


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 6])
def test_each_fix_is_either_retained_or_withheld(recording, seed):
    done = Withhold(every=4).apply(recording, seed)
    t_s = recording.position.t_s
    np.testing.assert_array_equal(done.position.t_s, t_s[seed % 4 :: 4])
    np.testing.assert_array_equal(done.reference.t_s, [t for i, t in enumerate(t_s) if i % 4 != seed % 4])
    np.testing.assert_array_equal(done.reference.enu_m[:, 0], done.reference.t_s)
    np.testing.assert_array_equal(done.reference.scored, done.reference.t_s >= 3)
    assert (done.reference.source, done.reference.independent) == (_SOURCE, False)
    assert (Withhold(every=5).replicates(), Withhold(every=5, phase=2).replicates()) == (5, 1)


@pytest.mark.parametrize("seed", range(4))
def test_the_velocity_of_a_withheld_epoch_is_withheld(recording, seed):
    done = Withhold(every=4).apply(delayed(recording), seed)
    retained = [float(i) for i in range(len(recording.position.t_s)) if i % 4 == seed]
    assert epochs_in(done.velocity) == [retained] * 3


def test_only_the_velocity_of_the_receiver_is_withheld_and_not_on_request(recording):
    assert Withhold(velocity=False).apply(recording, 0).velocity is recording.velocity
    t_s = np.arange(1000) / 83.0
    wheel = Velocity(t_s, np.ones((1000, 3)), np.tile(np.eye(3), (1000, 1, 1)))
    done = Withhold().apply(dataclasses.replace(recording, velocity=wheel), 0)
    np.testing.assert_array_equal(done.velocity.t_s, t_s)
    rows = np.arange(len(recording.position.t_s)) != 100
    v = recording.velocity
    holed = Velocity(v.t_s[rows] - 0.1, v.mps[rows], v.covariance_m2ps2[rows])
    done = Withhold().apply(dataclasses.replace(recording, velocity=holed), 1)
    np.testing.assert_allclose(done.velocity.t_s, done.position.t_s - 0.1, atol=1e-12)


def test_a_later_outage_and_an_earlier_fault_do_not_change_the_reference(recording):
    withheld = Withhold().apply(recording, 0)
    done = GnssOutage(windows_s=((40.0, 50.0),)).apply(withheld, 0)
    assert done.position.t_s.tolist() == [t for t in range(121) if not 40 <= t < 50]
    assert done.reference is withheld.reference
    assert ((done.reference.t_s > 40) & (done.reference.t_s < 50)).sum() == 30
    done = Withhold().apply(MultipathSingleAxis().apply(recording, 0), 0)
    np.testing.assert_array_equal(done.reference.enu_m[:, 0], done.reference.t_s)


def test_an_independent_reference_does_not_change_but_another_is_replaced_by_the_withheld_fixes(make):
    truth = Reference(np.arange(5.0), "the simulation", independent=True, enu_m=np.zeros((5, 3)))
    assert Withhold().apply(make(reference=truth), 0).reference is truth
    fused = Reference(np.arange(5.0) + 0.01, "the sensor's fusion", independent=False, enu_m=np.zeros((5, 3)))
    recording = make(reference=fused)
    done = Withhold(every=2).apply(recording, 0)
    np.testing.assert_array_equal(done.reference.enu_m, recording.position.enu_m[1::2])
    assert done.reference.scored.all()


def test_without_position_or_velocity(make):
    assert Withhold().apply(make(velocity=None), 0).velocity is None
    with pytest.raises(RecordingError, match="withhold cannot be applied"):
        Withhold().apply(make(position=None), 0)


def test_decimation_of_all_seeds_includes_every_fix_and_changes_only_the_position(recording, make):
    plugin = DecimatePosition(every=3)
    parts = [plugin.apply(recording, seed).position.t_s for seed in range(plugin.replicates())]
    np.testing.assert_array_equal(parts[1], recording.position.t_s[1::3])
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), recording.position.t_s)
    plugin = DecimatePosition(every=5, phase=2)
    done = plugin.apply(recording, 4)
    assert plugin.replicates() == 1
    np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m[2::5])
    assert done.velocity is recording.velocity
    assert done.reference is recording.reference
    without = make(position=None)
    assert DecimatePosition().apply(without, 0) is without
