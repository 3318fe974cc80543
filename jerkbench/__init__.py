"""jerkbench compares navigation filters: which filter is better, by how much, and on which recordings?

Run a combination of plugins from Python::

    run(dataset="field", filter={"name": "jerk", "accel_mps2": 0.2}, adaptation="mtf", seeds=3)   -> rows, a DataFrame

Plugins (data sets, disturbances, filters and others) exchange objects of three classes: `Recording`, `Attitude` and
`Estimate`. A `Recording` contains `Imu`, `Position`, `Velocity`, `Heading`, `Reference` and `Origin`.
`jerkbench.contracts` defines the members of each kind of plugin, and `register` registers a plugin. Every error that a
user can correct is a `JerkbenchError`.
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
