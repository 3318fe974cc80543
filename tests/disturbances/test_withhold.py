import dataclasses

import numpy as np
import pytest

from jerkbench.disturbances.multipath import MultipathSingleAxis
from jerkbench.disturbances.outages import GnssOutage
from jerkbench.disturbances.withhold import _SOURCE, DecimatePosition, Withhold
from jerkbench.errors import RecordingError
from jerkbench.io.clocks import velocity_when_true
from jerkbench.recording import Reference, Velocity

LATENCY_S = (0.125, 0.125, 0.275)  # up is more than one epoch old at 4 Hz


def delayed(recording):
    """Each velocity component carries the number of its epoch, so that a leak shows."""
    t_s = recording.position.t_s
    epoch = np.repeat(np.arange(len(t_s), dtype=float)[:, None], 3, axis=1)
    velocity = velocity_when_true(t_s, epoch, np.tile(np.eye(3), (len(t_s), 1, 1)), LATENCY_S)
    return dataclasses.replace(recording, velocity=velocity)


def epochs_in(velocity):
    return [sorted(velocity.mps[np.isfinite(velocity.mps[:, axis]), axis].tolist()) for axis in range(3)]


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 6])
def test_kept_and_withheld_share_out_the_fixes(recording, seed):
    done = Withhold(every=4).apply(recording, seed)
    t_s = recording.position.t_s
    np.testing.assert_array_equal(done.position.t_s, t_s[seed % 4 :: 4])
    np.testing.assert_array_equal(done.reference.t_s, [t for i, t in enumerate(t_s) if i % 4 != seed % 4])
    np.testing.assert_array_equal(done.reference.enu_m[:, 0], done.reference.t_s)
    np.testing.assert_array_equal(done.reference.scored, done.reference.t_s >= 3)
    assert (done.reference.source, done.reference.independent) == (_SOURCE, False)


@pytest.mark.parametrize("seed", range(4))
def test_no_velocity_of_a_withheld_epoch_is_left(recording, seed):
    done = Withhold(every=4).apply(delayed(recording), seed)
    kept = [float(i) for i in range(len(recording.position.t_s)) if i % 4 == seed]
    assert epochs_in(done.velocity) == [kept] * 3


def test_the_velocity_stays_when_asked(recording):
    assert Withhold(velocity=False).apply(recording, 0).velocity is recording.velocity


def test_another_sensors_velocity_stays(recording):
    t_s = np.arange(1000) / 83.0
    wheel = Velocity(t_s, np.ones((1000, 3)), np.tile(np.eye(3), (1000, 1, 1)))
    done = Withhold().apply(dataclasses.replace(recording, velocity=wheel), 0)
    np.testing.assert_array_equal(done.velocity.t_s, t_s)


def test_a_missing_velocity_row_does_not_shift_the_others(recording):
    rows = np.arange(len(recording.position.t_s)) != 100
    v = recording.velocity
    holed = Velocity(v.t_s[rows] - 0.1, v.mps[rows], v.covariance_m2ps2[rows])
    done = Withhold().apply(dataclasses.replace(recording, velocity=holed), 1)
    np.testing.assert_allclose(done.velocity.t_s, done.position.t_s - 0.1, atol=1e-12)


def test_an_outage_after_it_takes_kept_fixes_and_leaves_withheld_ones(recording):
    withheld = Withhold().apply(recording, 0)
    done = GnssOutage(windows_s=((40.0, 50.0),)).apply(withheld, 0)
    assert done.position.t_s.tolist() == [t for t in range(121) if not 40 <= t < 50]
    assert done.reference is withheld.reference
    assert ((done.reference.t_s > 40) & (done.reference.t_s < 50)).sum() == 30


def test_an_independent_reference_stays(make):
    truth = Reference(np.arange(5.0), "the simulation", independent=True, enu_m=np.zeros((5, 3)))
    assert Withhold().apply(make(reference=truth), 0).reference is truth


def test_the_reference_is_not_moved_by_an_earlier_disturbance(recording):
    done = Withhold().apply(MultipathSingleAxis().apply(recording, 0), 0)
    np.testing.assert_array_equal(done.reference.enu_m[:, 0], done.reference.t_s)


def test_another_reference_gives_way_to_the_withheld_fixes(make):
    fused = Reference(np.arange(5.0) + 0.01, "the sensor's fusion", independent=False, enu_m=np.zeros((5, 3)))
    recording = make(reference=fused)
    done = Withhold(every=2).apply(recording, 0)
    np.testing.assert_array_equal(done.reference.enu_m, recording.position.enu_m[1::2])
    assert done.reference.scored.all()


def test_without_position_or_velocity(make):
    assert Withhold().apply(make(velocity=None), 0).velocity is None
    with pytest.raises(RecordingError, match="none can be withheld"):
        Withhold().apply(make(position=None), 0)


def test_phases_and_replicates():
    assert Withhold(every=5).replicates() == 5
    assert Withhold(every=5, phase=2).replicates() == 1


def test_decimated_fixes_of_all_seeds_are_all_fixes(recording):
    plugin = DecimatePosition(every=3)
    parts = [plugin.apply(recording, seed).position.t_s for seed in range(plugin.replicates())]
    np.testing.assert_array_equal(parts[1], recording.position.t_s[1::3])
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), recording.position.t_s)


def test_decimation_leaves_velocity_and_reference_and_keeps_a_given_phase(make, recording):
    plugin = DecimatePosition(every=5, phase=2)
    done = plugin.apply(recording, 4)
    assert plugin.replicates() == 1
    np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m[2::5])
    assert done.velocity is recording.velocity
    assert done.reference is recording.reference
    without = make(position=None)
    assert DecimatePosition().apply(without, 0) is without
