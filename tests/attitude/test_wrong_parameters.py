"""Parameters of attitude filters that make no sense."""

import math

import pytest

from jerkbench.errors import PluginError
from jerkbench.plugins import create

WRONG = {
    "tilt": [
        ({"adapt": "mft"}, "no adapt of attitude tilt 'mft'. Did you mean 'mtf'"),
        ({"propagation": "euler"}, "no propagation of attitude tilt 'euler'"),
        ({"compensation": "mid"}, "no compensation of attitude tilt 'mid'"),
        ({"yaw_source": "compass"}, "no yaw_source of attitude tilt 'compass'"),
        ({"sigma_accel_mps2": 0.0}, "sigma_accel_mps2 is 0.0; it must be a positive number"),
        ({"initial_tilt_variance": -1.0}, "initial_tilt_variance is -1.0"),
        ({"course_min_speed_mps": 0.0}, "course_min_speed_mps is 0.0"),
        ({"course_sigma_min_rad": math.nan}, "course_sigma_min_rad is nan"),
        ({"sigma_gyro_radps": -1.0}, "sigma_gyro_radps is -1.0; it must be zero or positive"),
        ({"yaw_walk_rad_per_sqrt_s": -1.0}, "yaw_walk_rad_per_sqrt_s is -1.0"),
        ({"external_memory": 1.5}, "external_memory is 1.5; it must be from 0 to 1"),
        ({"window": 0}, "window is 0; it must be at least 1"),
        ({"adapt": "lee"}, "adapt lee with external_memory 0 never adapts"),
    ],
    "gyro_only": [
        ({"compensation": "mid"}, "no compensation of attitude gyro_only 'mid'"),
        ({"yaw_source": "compass"}, "no yaw_source of attitude gyro_only 'compass'"),
        ({"course_min_speed_mps": 0.0}, "course_min_speed_mps is 0.0"),
        ({"yaw_walk_rad_per_sqrt_s": -1.0}, "yaw_walk_rad_per_sqrt_s is -1.0"),
    ],
    "mekf": [
        ({"adapt": "mft"}, "no adapt of attitude mekf 'mft'"),
        ({"accel_density": 0.0}, r"accel_density is 0\.0; it must be a positive number"),
        ({"external_memory": 1.0}, r"external_memory is 1\.0; it must be between 0 and 1"),
        ({"window_s": 0.0}, r"window_s is 0\.0"),
        ({"gyro_density": -1.0}, r"gyro_density is -1\.0; it must be zero or positive"),
        ({"alignment": "compass"}, "no alignment of attitude mekf 'compass'"),
    ],
    "madgwick": [({"gain_per_s": -1.0}, r"attitude madgwick: gain_per_s is -1\.0")],
    "mahony": [({"integral_per_s2": -1.0}, r"attitude mahony: integral_per_s2 is -1\.0")],
    "vqf": [({"tau_acc_s": 0.0}, r"attitude vqf: tau_acc_s is 0\.0")],
    "offline_vqf": [({"alignment": "rest"}, "offline_vqf: alignment is rest")],
    "reference": [
        ({"compensation": "mid"}, "no compensation of attitude reference"),
        ({"gap_s": 0.0}, "gap_s is 0"),
    ],
}


@pytest.mark.parametrize(("name", "wrong", "reason"), [(name, *each) for name, all_ in WRONG.items() for each in all_])
def test_a_value_that_makes_no_sense_is_one_sentence(name, wrong, reason):
    with pytest.raises(PluginError, match=reason):
        create("attitude", {"name": name, **wrong})
