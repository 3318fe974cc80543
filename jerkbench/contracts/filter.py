"""The contract of a kinematic filter, and optional parts that an estimator may have too."""

from typing import Protocol, runtime_checkable

from jerkbench.arrays import FloatArray


@runtime_checkable
class Filter(Protocol):
    """A kinematic filter: the model of one axis; the full one is A (x) I3, b (x) I3, Q (x) I3, H = [I6 0].

    Optional, as for an `Estimator`: `ManyLengths` (of a kinematic one alone), `Batched` and `PerSeed` (of an estimator
    alone), `UsingImu`, `AttitudeOnly`, `Requiring`, `Labelled`, `ReadingFile`, `Remarking`.
    """

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (n, n), b (n,), Q (n, n) of one axis for a step of ``dt`` seconds.

        ``dt0`` is the nominal interval of the IMU: where a measurement splits a sample, white noise of the
        sample scales with dt0/dt, so that the velocity variances add up to the whole.
        """
        ...

    def initial_variances(self) -> FloatArray:
        """Return (n - 2,) initial variances of the states after position and velocity, the same for each axis."""
        ...


@runtime_checkable
class ManyLengths(Protocol):
    """What a kinematic filter may have as well, so that uneven stamps are quick: its models of many lengths at once."""

    def axis_models(self, dt: FloatArray, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (k, n, n), b (k, n), Q (k, n, n) for steps of ``dt`` (k,) seconds, as ``axis_model`` has each."""
        ...


@runtime_checkable
class UsingImu(Protocol):
    """A filter that says whether it uses the IMU: if not (its b is zero), it runs over recordings without one too."""

    @property
    def uses_imu(self) -> bool:
        """Whether it does; a filter that does not say does."""
        ...


@runtime_checkable
class Labelled(Protocol):
    """A filter that has another name in tables than its plugin's: one plugin stands for many methods."""

    @property
    def table_label(self) -> str:
        """What tables call it."""
        ...
