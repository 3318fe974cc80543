"""jerkbench: which navigation filter is better, by how much, on which recordings, and why?

From Python::

    run(dataset="field", filter={"name": "jerk", "accel_mps2": 0.2}, adaptation="mtf", seeds=3)   -> rows, a DataFrame

A data set, a disturbance or a filter of one's own is made of these: `Recording` with `Imu`, `Position`, `Velocity`,
`Heading`, `Reference` and `Origin`; `Attitude`; `Estimate`; what a plugin offers is in `jerkbench.contracts`, and
`register` makes it known. Every error that a user can put right is a `JerkbenchError`.
"""

from jerkbench.api import run
from jerkbench.errors import JerkbenchError
from jerkbench.estimate import Attitude, Estimate
from jerkbench.plugins import register
from jerkbench.random_streams import stream
from jerkbench.recording import Heading, Imu, Origin, Position, Recording, Reference, Velocity

__all__ = [
    "Attitude",
    "Estimate",
    "Heading",
    "Imu",
    "JerkbenchError",
    "Origin",
    "Position",
    "Recording",
    "Reference",
    "Velocity",
    "register",
    "run",
    "stream",
]
