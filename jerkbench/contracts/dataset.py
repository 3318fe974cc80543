"""The contract of a data set."""

from collections.abc import Hashable
from typing import ClassVar, Protocol, runtime_checkable

from jerkbench.recording import Recording


class Dataset(Hashable, Protocol):
    """A source of recordings; optional: `PreferringAttitude`, `AttitudeOnly`, `WithoutImu`.

    Attributes:
        seeded: whether another seed gives another recording (a simulation) or not (a file).
    """

    seeded: ClassVar[bool]

    def load(self, seed: int) -> Recording:
        """Return the recording; of a simulation, the one that belongs to ``seed``."""
        ...

    def fingerprint(self) -> str:
        """Return a hash of the data that `load` reads besides the parameters; empty where it reads none."""
        ...


@runtime_checkable
class PreferringAttitude(Protocol):
    """A data set that names the attitude filter, or preset, that suits it."""

    default_attitude: ClassVar[str]


@runtime_checkable
class WithoutImu(Protocol):
    """A data set that says whether its recordings lack an IMU: if so, only filters run that use none (`UsingImu`)."""

    @property
    def without_imu(self) -> bool:
        """Whether they do."""
        ...
