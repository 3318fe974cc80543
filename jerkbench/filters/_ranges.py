"""The ranges and origins that the noises of several filters share."""

from jerkbench.parameters import Origin, Range

ACCEL = Range(
    0.01,
    10.0,
    log=True,
    source="ours: from half of the simulated accelerometer's noise to the best of the baseline on a real car",
)
JERK_WALK = Range(0.1, 100.0, log=True, source="ours: that of the bias walk, times 2/dt at 100 Hz, without its ends")
BIAS_WALK = Range(1e-4, 1.0, log=True, source="ours: from a good MEMS sensor's wandering bias to leaking gravity")
ACCEL_WALK = Range(0.05, 50.0, log=True, source="ours: from a ship's to a race car's changes of acceleration")
VELOCITY_WALK = Range(0.01, 30.0, log=True, source="ours: from a slow robot's to a braking car's changes of velocity")
STAYS = Range(0.5, 0.999, toward_one=True, source="ours: from a model that lasts two updates to one that lasts 1000")

FIELD = Origin("tuned by hand on the simulated field; the paper gives no value")
START = Origin("ours: wide enough not to matter after the first seconds of the simulated field")
WALK = Origin("ours: a vehicle that changes its acceleration by 2 m/s2 within a second")
