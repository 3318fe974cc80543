"""Places in the array of the nominal state; each holds one number of each run."""

import itertools

LENGTHS = {
    "ATTITUDE": 9,
    "GYRO_BIAS": 3,
    "ACCEL_BIAS": 3,
    "RATE": 3,
    "FORCE": 3,
    "TURN": 9,
    "NEXT": 9,
    "BEFORE": 9,
    "BACK": 9,
    "LEVER": 9,
    "TWIST": 3,
    "SQUARE_OF_ANGLE": 1,
    "SINE": 1,
    "COSINE": 1,
    "INNOVATION": 1,
    "MEASURED": 1,
    "ROOM": 0,
}
"""LEVER is -dt C and TWIST -dt a, with C and the specific force a in the middle of a step.

SINE is sin(a)/a and COSINE (1 - cos(a))/a^2 of the angle a of a rotation. INNOVATION is that of a yaw, MEASURED 1 where
there is one.
"""

PLACES = dict(zip(LENGTHS, itertools.accumulate(LENGTHS.values(), initial=0), strict=False))

ATTITUDE, GYRO_BIAS, ACCEL_BIAS, RATE, FORCE = (PLACES[name] for name in list(LENGTHS)[:5])
TURN, NEXT, BEFORE, BACK, LEVER, TWIST = (PLACES[name] for name in list(LENGTHS)[5:11])
SQUARE_OF_ANGLE, SINE, COSINE, INNOVATION, MEASURED = (PLACES[name] for name in list(LENGTHS)[11:16])
