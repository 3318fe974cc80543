import numpy as np

from jerkbench.disturbances.withhold import DecimatePosition


def test_seeds_are_the_phases_and_together_they_are_all_fixes(recording):
    plugin = DecimatePosition(every=3)
    parts = [plugin.apply(recording, seed).position.t_s for seed in range(plugin.replicates())]
    np.testing.assert_array_equal(parts[1], recording.position.t_s[1::3])
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), recording.position.t_s)


def test_velocity_and_reference_stay_and_a_given_phase_is_kept(recording):
    plugin = DecimatePosition(every=5, phase=2)
    done = plugin.apply(recording, 4)
    assert plugin.replicates() == 1
    np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m[2::5])
    assert done.velocity is recording.velocity
    assert done.reference is recording.reference


def test_without_position_nothing_happens(make):
    recording = make(position=None)
    assert DecimatePosition().apply(recording, 0) is recording
