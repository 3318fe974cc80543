"""The combined field and the sweep of outages are presets: what Hydra makes of them."""

import pytest

from made_jobs import job_of_words


def test_everything_at_once_as_the_page_says():
    one = job_of_words("experiment=field_combined")
    dataset, (bias, multipath, rtk_float, outage) = one.scenario.dataset, one.scenario.disturbances
    assert one.labels.dataset == "field_combined"
    assert (dataset.ruts, dataset.vibration_mps2, dataset.impacts_per_s, dataset.roughness) == (True, 1.0, 0.1, 2.0)
    assert (bias.accel_mps2, bias.gyro_radps) == (0.05, 0.001)
    assert multipath.bursts == 4
    assert [sum(end - begin for begin, end in one.windows_s) for one in (rtk_float, outage)] == [15, 8]


def test_it_can_be_put_together_by_hand_too():
    by_hand = job_of_words("dataset=field_combined", "disturbance=combined")
    assert by_hand.scenario.disturbances == job_of_words("experiment=field_combined").scenario.disturbances
    assert job_of_words("disturbance=combined", "disturbance.rtk_float.time_s=5.0").scenario.disturbances[2].time_s == 5


def test_the_sweep_of_outages_has_a_seed_for_each_phase():
    one = job_of_words("experiment=outage_sweep", "disturbance.outage_sweep.length_s=30")
    assert one.scenario.disturbances[0].length_s == 30
    assert len(one.draws) == one.scenario.disturbances[0].replicates()
    assert one.labels.disturbance == "outage_sweep(length_s=30)"


@pytest.mark.parametrize("attitude", ["gyro_only", "reference"])
def test_attitudes_and_the_path_are_chosen_by_name(attitude):
    one = job_of_words("dataset=path", "dataset.waypoints_m=[[0,0],[9,0]]", f"attitude={attitude}")
    assert one.scenario.dataset.waypoints_m == ((0, 0), (9, 0))
    assert one.spec["attitude"]["name"] == attitude


def test_two_of_the_same_disturbance_under_keys_of_their_own():
    words = ["disturbance=imu_bias", "+disturbance@disturbance.second=imu_bias", "disturbance.second.stream=second"]
    first, second = job_of_words(*words).scenario.disturbances
    assert (first.stream, second.stream) == ("", "second")
