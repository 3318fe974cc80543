"""Places of a run in its array, for each size of the error state.

A compilation replaces these places by those of the size at hand.
"""

import itertools
from functools import cache

from jerkbench.compilation.vectors import WIDE
from jerkbench.inertial.state import STATES as SMALLEST
from jerkbench.inertial.state import has_deformation, has_wheel

NAVIGATION = 9
"""Number of error states of position, velocity and attitude: those that move."""

APART = 7
"""How many numbers of a row lie between the attitude and what is known of the sensors."""

NUMBERS = {
    "POSITION": 3,
    "VELOCITY": 3,
    "ATTITUDE": 9,
    "GYRO_BIAS": 3,
    "ACCEL_BIAS": 3,
    "GYRO_MATRIX": 9,
    "ACCEL_MATRIX": 9,
    "WHEEL": 1,
    "RATE": 3,
    "FORCE": 3,
    "TURN": 9,
    "NEXT": 9,
    "BEFORE": 9,
    "BACK": 9,
    "PUSH": 3,
    "SHIFT": 6,
    "LEVER": 9,
    "TWIST": 3,
    "EXPECTED": 6,
    "Y": 6,
    "U": 6,
    "R": 36,
    "HPHT": 36,
    "S": 36,
    "NOISED": 1,
    "LENGTH": 0,
}
"""Lengths of what is not read in vectors; matrices row by row, deformations column by column.

SHIFT is by how much a correction moves position and velocity. LEVER is -dt C and TWIST -dt a, with C and the specific
force a in the middle of a step. NOISED is the length of the step that the process noise belongs to.
"""


@cache
def places(states: int, *, invariant: bool = False) -> dict[str, int]:
    """Return the sizes and places for an error state of that size; corrected on the group if it is ``invariant``."""
    pieces = -(-(states - NAVIGATION) // WIDE)
    row = 2 + pieces
    vectors = {
        "P": row * (NAVIGATION + WIDE * pieces),
        "SPARE": row * (NAVIGATION + WIDE * pieces),
        "NOISE": NAVIGATION,  # of navigation, without its last column
        "WALK": 6,  # of the biases
        "H": 6 * row,
        "W": 6 * row,
        "K": 6 * row,
        "V": 6 * row,
        "DX": row,
        "ZERO": 1,  # never written
        "FIRST": 0,
    }
    at = dict(zip(vectors, itertools.accumulate(vectors.values(), initial=0), strict=False))
    start = WIDE * at.pop("FIRST")
    numbers = dict(zip(NUMBERS, itertools.accumulate(NUMBERS.values(), initial=start), strict=False))
    sizes = {"STATES": states, "PIECES": pieces, "ROW": row, "STRIDE": WIDE * row}
    numbered = {f"{name}_AT": WIDE * at[name] for name in ("P", "SPARE", "NOISE", "WALK", "H", "W", "K", "DX")}
    kinds = {"DEFORMED": int(has_deformation(states)), "WHEELED": int(has_wheel(states)), "INVARIANT": int(invariant)}
    return {**sizes, **kinds, **at, **numbered, **numbers}


_PLACES = places(SMALLEST)
STATES, PIECES, ROW, STRIDE, DEFORMED, WHEELED, INVARIANT = (
    _PLACES[name] for name in ("STATES", "PIECES", "ROW", "STRIDE", "DEFORMED", "WHEELED", "INVARIANT")
)
P, SPARE, NOISE, WALK, H, W, K, V, DX, ZERO = (
    _PLACES[name] for name in ("P", "SPARE", "NOISE", "WALK", "H", "W", "K", "V", "DX", "ZERO")
)
P_AT, SPARE_AT, NOISE_AT, WALK_AT, H_AT, W_AT, K_AT, DX_AT = (
    _PLACES[f"{name}_AT"] for name in ("P", "SPARE", "NOISE", "WALK", "H", "W", "K", "DX")
)
POSITION, VELOCITY, ATTITUDE, GYRO_BIAS, ACCEL_BIAS, GYRO_MATRIX, ACCEL_MATRIX, WHEEL = (
    _PLACES[name] for name in list(NUMBERS)[:8]
)
RATE, FORCE, TURN, NEXT, BEFORE, BACK, PUSH, SHIFT, LEVER, TWIST = (_PLACES[name] for name in list(NUMBERS)[8:18])
EXPECTED, Y, U, R, HPHT, S, NOISED, LENGTH = (_PLACES[name] for name in list(NUMBERS)[18:])


def column(state: int) -> int:
    """Return the place of a state in a row."""
    return state if state < NAVIGATION else state + APART
