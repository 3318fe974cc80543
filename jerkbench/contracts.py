"""The protocol (interface) of each kind of plugin. A plugin implements its protocol, but does not inherit from it.

Each kind (`Dataset`, `Disturbance`, `AttitudeFilter`, `Filter` (kinematic), `Estimator` (any other filter),
`Adaptation`, `Engine`, `Metric`) has a protocol with the members that every plugin of this kind needs. The docstring
of a protocol lists the optional attributes with their defaults. Optional methods with several arguments have separate
protocols. `jerkbench.plugins` lists the optional members of each kind of plugin. A plugin with a misspelt optional
member is rejected when the plugin is registered.

Optional attributes of every kind:

- ``citations: ClassVar[tuple[str, ...]]``: BibTeX entries. By default, the DOIs in the docstring are cited.
- ``depends_on: ClassVar[tuple[str, ...]]``: files and folders that the plugin reads, relative to the folder of its
  module, and environment variables as "$NAME". If a file, folder or variable changes, stored runs are computed again.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cache
from typing import Any, ClassVar, Literal, Protocol, Self, TypeGuard, TypeVar, cast, runtime_checkable

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Attitude, Estimate, Streamed, Sums
from jerkbench.recording import Recording
from jerkbench.timeline import RecordedRun, Run, Timeline

# Protocols of optional methods that several kinds of plugins can have.


@runtime_checkable
class ReadingFile(Protocol):
    """A disturbance or filter that reads a file. If the content changes, stored runs are computed again."""

    def fingerprint(self) -> str:
        """Return a hash of the content of the file, or an empty string if the file is part of this package."""


@runtime_checkable
class Requiring(Protocol):
    """An attitude filter or filter that cannot process every recording."""

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before any run of a sweep, that the recording that ``load`` returns has the required inputs.

        Raises:
            RecordingError: An input is missing.
        """


@runtime_checkable
class Remarking(Protocol):
    """An attitude filter or filter that adds notes below tables."""

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return notes about a recording as sentences. A note must not contain numbers that depend on the seed."""


# Data sets.


class Dataset(Hashable, Protocol):
    """A source of recordings.

    Optional attributes:

    - ``default_attitude: ClassVar[str]``: the attitude filter, or preset, that suits the data set.
    - ``attitude_only: bool = False``: the recordings have no positions. Only filters whose ``attitude_only`` is True
      can run.
    - ``without_imu: bool = False``: the recordings have no IMU. Only filters whose ``uses_imu`` is False can run.

    Attributes:
        seeded: True if the recording depends on the seed (simulation), False for a file.
    """

    seeded: ClassVar[bool]

    def load(self, seed: int) -> Recording:
        """Return the recording. A simulation generates the recording from ``seed``."""

    def fingerprint(self) -> str:
        """Return a hash of the files that `load` reads, or an empty string if `load` reads no files."""


# Disturbances.


class Disturbance(Hashable, Protocol):
    """A disturbance, which changes a recording. A disturbance may also implement `ReadingFile`.

    Attributes:
        seeded: True if the disturbance draws random numbers.
    """

    seeded: ClassVar[bool]

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the disturbed recording. All random numbers must come from `jerkbench.random_streams.stream`."""

    def replicates(self) -> int:
        """Return the number of seeds 0, 1, ... with different results, for a disturbance without random numbers.

        For example, a decimation by n has n different results, one for each phase.
        """


# Attitude filters.


class AttitudeFilter(Hashable, Protocol):
    """Estimates the attitude. An attitude filter may also implement `Requiring` and `Remarking`."""

    def estimate(self, recording: Recording) -> Attitude:
        """Return the attitude and the gravity-compensated acceleration at the stamps of the IMU."""


# Kinematic filters.


@runtime_checkable
class Filter(Protocol):
    """A kinematic filter, defined by the model of one axis. The full model is A (x) I3, b (x) I3, Q (x) I3, H = [I6 0].

    A kinematic filter may also implement `Requiring`, `ReadingFile`, `Remarking`, and the following method:

    - ``axis_models(dt: FloatArray, dt0: float)``: returns A (k, n, n), b (k, n), Q (k, n, n) of `axis_model` for ``dt``
      (k,). With this method, runs over recordings with irregular stamps are faster.

    Optional attributes of a kinematic filter and of an `Estimator`:

    - ``uses_imu: bool = True``: False if the filter does not use the IMU (b is zero). A filter that does not use the
      IMU also runs with recordings that have no IMU.
    - ``attitude_only: bool = False``: True if the filter estimates no position.
    - ``table_label: str``: name of the filter in tables, for a plugin that represents many methods.
    - ``provenance: ClassVar[Provenance]``: whether the method is published, simplified, or original.
    """

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (n, n), b (n,), Q (n, n) of one axis for a step of ``dt`` seconds.

        ``dt0`` is the nominal interval of the IMU. If a measurement divides the interval between two IMU samples, the
        white noise scales with dt0/dt, so that the velocity variances of the two parts add up to the variance of the
        full interval.
        """

    def initial_variances(self) -> FloatArray:
        """Return the initial variances (n - 2,) of all states of one axis except position and velocity."""


# Adaptations: rules that change R.


class Adaptation(Protocol):
    """A rule that changes R between prediction and update.

    An adaptation that changes more than R also implements `Fading`, `AdaptingPrior` or `AdaptingGain`. Other optional
    methods:

    - ``memory_size() -> int``: length of the memory, 0 by default.
    - ``memory_size_of(states: int) -> int``: length of the memory if the length depends on the number of states of the
      filter.
    - ``at_updates(since_start_s: FloatArray) -> Self``: returns the adaptation for one run. The method is called before
      the run with the times (m,) of the updates since the start [s]. For example, the method converts a parameter in
      seconds to a number of updates.

    Optional attributes:

    - ``wants_true_covariance: ClassVar[bool] = False``: True if the adaptation receives the true covariance as R.
    - ``lanes: ClassVar[bool] = False``: True if the adaptation can be called for a batch of runs
      (`jerkbench.compilation.lanes`). In a batch, each number is a vector with one element for each run, and the code
      must not branch on its value.
    - ``varying: ClassVar[tuple[str, ...]] = ()``: integer parameters that may differ between the runs of a batch.
      Arithmetic, `select` and `each_run` accept varying parameters. The limit of a loop must be equal in all runs.
    - ``changes_nothing: ClassVar[bool] = False``: True if the adaptation never changes R, P and the gain. In this case,
      compiled runs do not call the adaptation. A subclass does not inherit the attribute.
    - ``provenance: ClassVar[Provenance]``: whether the method is published, simplified, or original.
    """

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the R for the update.

        Args:
            innovation: Innovation y = z - H x (m,) of the measured rows.
            HPHt: Covariance H P- H' (m, m) of the predicted measurement.
            R: Reported covariance (m, m). No diagonal element is below the variance floor.
            rows: Indices (m,) of the measured rows among the six rows of z (0 to 2: position, 3 to 5: velocity).
            memory: Memory of the adaptation (``memory_size()``,), zero at the start of a run. The adaptation may change
                only this array in place.

        Returns:
            The adapted R (m, m). A row with an infinite variance is dropped. If all rows are dropped, the update is
            skipped.
        """


@runtime_checkable
class Fading(Protocol):
    """An adaptation that multiplies the prior covariance by a factor."""

    def fade(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> float:
        """Return the factor on the prior covariance. `Adaptation.adapt` is called afterwards with the faded H P- H'.

        The arguments are the same as in `Adaptation.adapt`.
        """


@runtime_checkable
class AdaptingPrior(Protocol):
    """An adaptation that replaces the prior covariance, for example to adapt Q, or P and R together."""

    def adapt_prior(
        self,
        x: FloatArray,
        P: FloatArray,
        F: FloatArray,
        Q: FloatArray,
        innovation: FloatArray,
        R: FloatArray,
        rows: IntArray,
        memory: FloatArray,
    ) -> FloatArray:
        """Return the prior covariance for the update.

        This method is called after `Fading.fade` and before `Adaptation.adapt`, which receives H P H' with the returned
        P. The method can pass information about R to `adapt` in the memory. F and Q cover all steps since the last
        update. Unless P was faded, P = F P+ F' + Q, where P+ is the posterior covariance of the last update or the
        initial covariance.

        Args:
            x: Prior state (n,). Position and velocity come first, so that H x is ``x[rows]`` and H P H' is
                ``P[rows][:, rows]``.
            P: Prior covariance (n, n).
            F: Transition matrix since the last update (n, n).
            Q: Process noise since the last update (n, n).
            innovation: Innovation y = z - H x (m,) of the measured rows.
            R: Reported covariance (m, m).
            rows: Indices (m,) of the measured rows among the six rows of z.
            memory: Memory of the adaptation. The adaptation may change only this array in place.

        Returns:
            The prior covariance (n, n), symmetric and positive definite.
        """


@runtime_checkable
class AdaptingGain(Protocol):
    """An adaptation that computes the gain K of the update: x + K y and P = (I - K H) P (I - K H)' + K R K'."""

    def adapt_gain(
        self, x: FloatArray, P: FloatArray, innovation: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the gain K (n, m) that replaces P H' S^-1. This method is called after `Adaptation.adapt`.

        The arguments have the same meaning as in `AdaptingPrior.adapt_prior`. P and R are the adapted covariances, and
        the arrays do not contain dropped rows.
        """


# Estimators: filters that are not kinematic.


@runtime_checkable
class Estimator(Protocol):
    """Any filter that is not kinematic. In the configuration, estimators belong to the group ``filter``.

    An estimator may also implement `Batched`, `PerSeed`, `Requiring`, `ReadingFile` and `Remarking`, and have the
    optional attributes of a `Filter`.

    Attributes:
        adaptations: Names of the supported adaptations. A sweep leaves out combinations with unsupported adaptations.
    """

    adaptations: ClassVar[tuple[str, ...]]

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the stamps of the reference."""


@runtime_checkable
class Batched(Protocol):
    """An estimator with two compiled methods: one returns trajectories, and one returns only sums.

    ``estimate`` is the reference implementation, which the engine `filterpy` runs. An engine that implements
    `SideBySide` runs the compiled implementation. `jerkbench.testing.check_filter` compares both implementations. If a
    compiled method returns None for a run, ``estimate`` runs instead, and raises the error of the run.
    """

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return the same result as ``estimate``, or None if ``estimate`` has to run instead."""

    def run_settings(
        self,
        runs: Sequence[RecordedRun],
        estimators: Sequence[Self],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        attitude: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Run all ``runs`` without storing trajectories. An error in one run does not affect the other runs.

        Args:
            runs: Recordings with their attitudes and scoring.
            estimators: The estimator of each run. All estimators have the same class.
            adaptations: The adaptation of each run. All adaptations have the same class.
            updates: Whether to store the data of the measurement updates.
            attitude: Whether to store the attitude, if the estimator estimates it.
            threads: Number of threads.

        Returns:
            The sums of each run, or None if ``estimate`` has to run instead. If a run diverges, `Streamed.rows_left` of
            its sums is positive.
        """


@runtime_checkable
class PerSeed(Protocol):
    """An estimator that depends on the seed, for example because it reads one file for each seed.

    Each seed is a separate run. If the attribute ``random`` of the estimator is true, seeds are separate runs even if
    their recordings are equal.
    """

    @property
    def for_each_seed(self) -> bool:
        """True if there is an estimator for each seed. If False, only one seed can run."""

    def of_seed(self, seed: int) -> Estimator:
        """Return the estimator for ``seed``."""


# Engines.


class Engine(Protocol):
    """Runs a kinematic filter with an adaptation. An engine may also implement `SideBySide`, which runs batches."""

    def run(self, timeline: Timeline, model: Filter, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the stamps of the reference."""


@runtime_checkable
class SideBySide(Protocol):
    """An engine that runs many timelines in a batch without storing trajectories."""

    def run_settings(
        self,
        runs: Sequence[Run],
        models: Sequence[Filter],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Return the sums of each run, or None for a run that `Engine.run` has to run instead.

        If a run diverges, `Streamed.rows_left` is positive. An error in one run does not affect the other runs.

        Args:
            runs: Timelines and scoring.
            models: The filter of each run.
            adaptations: The adaptation of each run.
            updates: Whether to store the data of the measurement updates.
            threads: Number of threads.
        """


# Metrics.


class Metric(Protocol):
    """Computes one or several numbers from a run. A metric may also implement `Summarising`.

    If all metrics of a sweep are `Summarising` or have ``reads``, the sweep runs without trajectories and is many times
    faster.

    Optional attributes:

    - ``columns: ClassVar[Mapping[str, Column]]``: titles and interpretation of the columns. By default, the lowest
      value is the best.
    - ``reads: ClassVar[Literal["attitude", "updates"]]``: the part of the estimate that the metric reads. With
      "attitude", the metric reads only ``index`` and ``euler_rad``. With "updates", the metric also reads ``updates``.
    - ``default: ClassVar[bool] = True``: if False, the metric is computed only on request (``metrics=[name]``).
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value of each column. The name of a column includes its unit.

        The value is NaN if the metric does not apply to the run.
        ``counted`` (k,) marks the rows of the estimate that are scored: rows with a reference after the burn-in.
        """


@runtime_checkable
class Summarising(Protocol):
    """A metric that needs only the sums of a run."""

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the same values as `Metric.evaluate`, computed from the sums of a run."""


CONTRACTS: Mapping[str, type] = {
    "dataset": Dataset,
    "disturbance": Disturbance,
    "attitude": AttitudeFilter,
    "filter": Filter,
    "estimator": Estimator,
    "adaptation": Adaptation,
    "engine": Engine,
    "metric": Metric,
}
"""The protocol of each kind. A plugin of the kind "filter" satisfies either "filter" or "estimator"."""

# Functions that return an optional member of a plugin, or its default.

_P = TypeVar("_P")


def has_methods(plugin: object, protocol: type[_P]) -> TypeGuard[_P]:
    """Return whether a plugin has the methods of a protocol without attributes. This is faster than `isinstance`."""
    return _has_methods(cast("type", type(plugin)), cast("type", protocol))


@cache
def _has_methods(cls: type, protocol: type) -> bool:
    return issubclass(cls, protocol)


def preferred_attitude(dataset: object) -> str | None:
    """Return the name of the attitude filter that a data set (or its class) prefers, or None."""
    return getattr(dataset, "default_attitude", None)


def is_attitude_only(plugin: object) -> bool:
    """Return whether a data set has no positions, or a filter estimates no positions."""
    return getattr(plugin, "attitude_only", False) is True


def uses_imu(model: object) -> bool:
    """Return whether a filter or its class uses the IMU. Return True for a class if this depends on its parameters."""
    return getattr(model, "uses_imu", True) is not False


def clocked(adaptation: _P, timeline: Timeline) -> _P:
    """Return the result of the method `at_updates` of the adaptation, or the adaptation if it lacks this method."""
    at_updates = getattr(adaptation, "at_updates", None)
    return at_updates(timeline.update_times_s) if at_updates else adaptation


def empty_memory(adaptation: object, states: int = 6) -> FloatArray:
    """Return the memory of an adaptation at the start of a run (zeros), for a filter with ``states`` states."""
    return np.zeros(memory_size(adaptation, states))


def memory_size(adaptation: Any, states: int) -> int:  # noqa: ANN401 - has optional methods
    """Return the length of the memory of an adaptation. ``states`` is the number of states of the filter."""
    if hasattr(adaptation, "memory_size_of"):
        return int(adaptation.memory_size_of(states))
    return int(adaptation.memory_size()) if hasattr(adaptation, "memory_size") else 0


def wants_truth(adaptation: object) -> bool:
    """Return whether an adaptation receives the true covariance as R."""
    return bool(getattr(adaptation, "wants_true_covariance", False))


def asked_in_lanes(adaptation: object) -> bool:
    """Return whether an adaptation is called once for a batch of runs, instead of once for each run."""
    return bool(getattr(adaptation, "lanes", False)) and not has_methods(adaptation, Fading)


def changes_nothing(adaptation: object) -> bool:
    """Return whether the class of an adaptation declares (not inherits) that R, P and the gain never change."""
    return bool(vars(type(adaptation)).get("changes_nothing", False))


def part_read(metric: object) -> Literal["attitude", "updates", "everything"]:
    """Return the part of an estimate that a metric reads."""
    reads = getattr(metric, "reads", "everything")
    return "attitude" if reads == "attitude" else "updates" if reads == "updates" else "everything"


def axis_models(model: Filter, lengths_s: FloatArray, dt0_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A (k, n, n), b (k, n), Q (k, n, n) of steps of ``lengths_s`` (k,). For 0 s, A = I, b = 0, Q = 0."""
    n, k = 2 + len(model.initial_variances()), len(lengths_s)
    A, b, Q = np.tile(np.eye(n), (k, 1, 1)), np.zeros((k, n)), np.zeros((k, n, n))
    passing = np.flatnonzero(lengths_s > 0)
    axis_models_of = getattr(model, "axis_models", None)
    if axis_models_of and len(passing):
        A[passing], b[passing], Q[passing] = axis_models_of(lengths_s[passing], dt0_s)
        return A, b, Q
    for row in passing.tolist():
        A[row], b[row], Q[row] = model.axis_model(float(lengths_s[row]), dt0_s)
    return A, b, Q
