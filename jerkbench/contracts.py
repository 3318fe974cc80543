"""What a plugin of each kind offers. A plugin need not inherit from these; it only has to fit."""

from collections.abc import Hashable
from typing import ClassVar, Protocol, runtime_checkable

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Attitude, Estimate
from jerkbench.recording import Recording
from jerkbench.timeline.timeline import Timeline


class Dataset(Hashable, Protocol):
    """A source of recordings.

    Three attributes are optional: ``default_attitude`` names the attitude filter that suits it; ``attitude_only =
    True`` says that it has nothing to navigate by, so that only a filter with the same attribute runs over it;
    ``without_imu = True`` says that its recordings have no IMU, so that only filters with ``uses_imu = False`` do.

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


class Disturbance(Hashable, Protocol):
    """A change of a recording.

    Attributes:
        seeded: whether it draws random numbers.
    """

    seeded: ClassVar[bool]

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the disturbed recording. Random numbers come from `jerkbench.random_streams.stream` alone."""
        ...

    def replicates(self) -> int:
        """Return how many different results seeds 0, 1, 2, ... give without any randomness (phases of a decimation)."""
        ...


class AttitudeFilter(Hashable, Protocol):
    """A way to find the attitude.

    One thing is optional. ``require(self, load)`` is called before a sweep begins; it raises a RecordingError where the
    recording that ``load()`` returns lacks what the parameters ask for.
    """

    def estimate(self, recording: Recording) -> Attitude:
        """Return the attitude and the gravity-compensated acceleration at the IMU's stamps."""
        ...


@runtime_checkable
class Remarking(Protocol):
    """An attitude filter that has something to say of what it makes of a recording; optional."""

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return sentences that a reader of the table has to know, without numbers that change from seed to seed."""
        ...


@runtime_checkable
class Filter(Protocol):
    """A kinematic filter: the model of one axis; the full one is A (x) I3, b (x) I3, Q (x) I3, H = [I6 0].

    A class attribute ``uses_imu = False`` says that b is zero, so that it runs over recordings without an IMU too.
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
class Estimator(Protocol):
    """Anything that is not a kinematic filter; it stands in the group ``filter`` too."""

    adaptations: ClassVar[tuple[str, ...]]
    """Names of the adaptations that it accepts; a sweep leaves the others out."""

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: "Adaptation") -> Estimate:
        """Return the navigation solution at the reference's stamps."""
        ...


class Adaptation(Protocol):
    """A rule that changes R (and may fade P) between predict and update.

    Three things are optional. ``memory_size(self) -> int`` is the length of the memory that `adapt` gets; without it
    there is none. ``fade(self, innovation, HPHt, R, rows, memory) -> float`` is called first and gives a factor on the
    prior covariance. A class attribute ``wants_true_covariance = True`` asks for the true covariance as R.
    """

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the R to use.

        Args:
            innovation: (m,) y = z - H x of the rows that are there.
            HPHt: (m, m) H P- H'.
            R: (m, m) as reported, diagonal not below the floor.
            rows: (m,) which of the six rows these are (0-2 position, 3-5 velocity).
            memory: (``memory_size()``,) float64, zero at the start of a run; only this may be changed in place.

        Returns:
            (m, m). An infinite variance drops its row; with all dropped there is no update.
        """
        ...


class Engine(Protocol):
    """A way to run a kinematic filter with an adaptation; all engines have the same inputs and outputs.

    Two things are optional, `jerkbench.engines.compiled_engine` has both: ``run_many`` runs many timelines without
    keeping trajectories, and what one of them raises harms no other; ``prepare(model)`` begins with what `run` will
    need, while a single run does something else.
    """

    def run(self, timeline: Timeline, model: Filter, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""
        ...


class Metric(Protocol):
    """A number, or a few, from one run.

    A class attribute ``default = False`` says that it is only computed where it is asked for (``metrics=[name]``).

    Two more things are optional; a cell all of whose metrics have one of them runs without storing trajectories, which
    is many times faster. ``summarise(sums: jerkbench.evaluation.sums.Sums) -> dict[str, float]`` gives the same as
    `evaluate` from sums over the run alone. A class attribute ``reads`` says that `evaluate` looks at less than all of
    the estimate: "attitude" (``index`` and ``euler_rad``) or "updates" (these and ``updates``).
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the values by column name (unit included); NaN where it does not apply.

        ``counted`` (k,) says which rows of the estimate count: the reference is scored there, after the burn-in.
        """
        ...
