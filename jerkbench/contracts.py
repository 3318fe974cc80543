"""The interfaces of plugins, kind by kind. A plugin does not inherit from them; it only has to have their members.

Each kind (`Dataset`, `Disturbance`, `AttitudeFilter`, `Filter` (kinematic), `Estimator` (any other filter),
`Adaptation`, `Engine`, `Metric`) has one protocol with the members that every plugin of this kind needs. Its docstring
lists the optional attributes with their defaults. Optional methods with several arguments have protocols of their own.
`jerkbench.plugins` lists the optional members of each kind; a misspelt one is refused at registration.

Optional attributes of every kind:

- ``citations: ClassVar[tuple[str, ...]]``: BibTeX entries. By default the DOIs of the docstring are cited.
- ``depends_on: ClassVar[tuple[str, ...]]``: files and folders that the plugin reads, relative to the folder of its
  module, and environment variables as "$NAME". A change of one of them leads to new runs.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cache
from typing import Any, ClassVar, Literal, Protocol, Self, TypeGuard, TypeVar, cast, runtime_checkable

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Attitude, Estimate, Streamed, Sums
from jerkbench.recording import Recording
from jerkbench.timeline import RecordedRun, Run, Timeline

# Optional methods of several kinds


@runtime_checkable
class ReadingFile(Protocol):
    """A disturbance or a filter that reads a file. The content of the file is part of the key of a result."""

    def fingerprint(self) -> str:
        """Return a hash of the content of the file. Empty if it is part of this package."""


@runtime_checkable
class Requiring(Protocol):
    """An attitude filter or a filter that does not accept every recording."""

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before a sweep starts, that the recording returned by ``load`` has the inputs that are needed.

        Raises:
            RecordingError: an input is missing.
        """


@runtime_checkable
class Remarking(Protocol):
    """An attitude filter or a filter that adds notes to the table."""

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return notes about a recording, as sentences without numbers that change from seed to seed."""


# Data sets


class Dataset(Hashable, Protocol):
    """A source of recordings.

    Optional attributes:

    - ``default_attitude: ClassVar[str]``: the attitude filter, or preset, that suits the data set.
    - ``attitude_only: bool = False``: the recordings have no positions; only filters with ``attitude_only`` run.
    - ``without_imu: bool = False``: the recordings have no IMU; only filters run whose ``uses_imu`` is False.

    Attributes:
        seeded: True if another seed gives another recording (simulation), False for a file.
    """

    seeded: ClassVar[bool]

    def load(self, seed: int) -> Recording:
        """Return the recording; of a simulation, the one that belongs to ``seed``."""

    def fingerprint(self) -> str:
        """Return a hash of the data that `load` reads besides the parameters. Empty if it reads none."""


# Disturbances


class Disturbance(Hashable, Protocol):
    """A change of a recording. Optional: `ReadingFile`.

    Attributes:
        seeded: True if it draws random numbers.
    """

    seeded: ClassVar[bool]

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the disturbed recording. Random numbers come from `jerkbench.random_streams.stream` only."""

    def replicates(self) -> int:
        """Return how many different results seeds 0, 1, 2, ... give without randomness (phases of a decimation)."""


# Attitude filters


class AttitudeFilter(Hashable, Protocol):
    """Estimates the attitude. Optional: `Requiring`, `Remarking`."""

    def estimate(self, recording: Recording) -> Attitude:
        """Return the attitude and the gravity-compensated acceleration at the stamps of the IMU."""


# Kinematic filters


@runtime_checkable
class Filter(Protocol):
    """A kinematic filter: the model of one axis. The full model is A (x) I3, b (x) I3, Q (x) I3, H = [I6 0].

    Optional methods: `Requiring`, `ReadingFile`, `Remarking`, and

    - ``axis_models(dt: FloatArray, dt0: float)``: A (k, n, n), b (k, n), Q (k, n, n) of `axis_model` for ``dt`` (k,).
      It makes recordings with irregular stamps faster.

    Optional attributes, also of an `Estimator`:

    - ``uses_imu: bool = True``: if False (its b is zero), the filter also runs over recordings without an IMU.
    - ``attitude_only: bool = False``: the filter estimates no position.
    - ``table_label: str``: its name in tables, if one plugin stands for many methods.
    - ``provenance: ClassVar[Provenance]``: as published, simplified, or original.
    """

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (n, n), b (n,), Q (n, n) of one axis for a step of ``dt`` seconds.

        ``dt0`` is the nominal interval of the IMU. If a measurement divides a sample, the white noise of the sample
        scales with dt0/dt, so that the velocity variances of the parts add up to that of the full sample.
        """

    def initial_variances(self) -> FloatArray:
        """Return (n - 2,) initial variances of the states after position and velocity, the same for each axis."""


# Adaptations: rules on R


class Adaptation(Protocol):
    """A rule that changes R between predict and update.

    A rule that changes more than R is also `Fading`, `AdaptingPrior` or `AdaptingGain`. Other optional methods:

    - ``memory_size() -> int``: length of the memory, 0 by default. If it depends on the number of states of the filter:
      ``memory_size_of(states: int) -> int``.
    - ``at_updates(since_start_s: FloatArray) -> Self``: called before a run with the times (m,) of its updates, seconds
      since its start. Returns the rule for this run. A rule with a parameter in seconds can count the updates there.

    Optional attributes:

    - ``wants_true_covariance: ClassVar[bool] = False``: R is the true covariance (an oracle).
    - ``lanes: ClassVar[bool] = False``: the rule can be called for several runs at once
      (`jerkbench.compilation.lanes`). Its numbers are vectors then, and it must not branch on them.
    - ``varying: ClassVar[tuple[str, ...]] = ()``: integer parameters that may differ between the runs of such a call.
      Arithmetic, `chosen` and `each_run` accept them; loops need parameters that are the same in all runs.
    - ``changes_nothing: ClassVar[bool] = False``: R, P and the gain stay as they are, so compiled runs do not call it.
      It is not inherited.
    - ``provenance: ClassVar[Provenance]``: as published, simplified, or original.
    """

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the R to use.

        Args:
            innovation: (m,) y = z - H x of the available rows.
            HPHt: (m, m) H P- H'.
            R: (m, m) reported covariance; its diagonal is not below the floor.
            rows: (m,) indices of these rows among the six (0-2 position, 3-5 velocity).
            memory: (``memory_size()``,) zero at the start of a run. Only this array may be changed in place.

        Returns:
            (m, m). An infinite variance drops its row. If all rows are dropped, there is no update.
        """


@runtime_checkable
class Fading(Protocol):
    """An adaptation that multiplies the prior covariance by a number."""

    def fade(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> float:
        """Return the factor on the prior covariance. It is called first; `adapt` then receives the faded HPHt.

        The arguments are those of `Adaptation.adapt`.
        """


@runtime_checkable
class AdaptingPrior(Protocol):
    """An adaptation that replaces the prior covariance: P and Q, or prior and R together."""

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
        """Return the prior covariance to use.

        It is called after `Fading.fade` and before `Adaptation.adapt`, which receives the changed H P H'. It can pass
        information about R to `adapt` through the memory. F and Q are those of all steps since the last update, P+ the
        posterior of this update (at the first update the start): P = F P+ F' + Q unless P was faded.

        Args:
            x: (n,) prior state. Position and velocity come first: H x is ``x[rows]``, H P H' ``P[rows][:, rows]``.
            P: (n, n) its covariance.
            F: (n, n) transition since the last update.
            Q: (n, n) process noise since the last update.
            innovation: as in `adapt`.
            R: as in `adapt`.
            rows: as in `adapt`.
            memory: as in `adapt`.

        Returns:
            (n, n), symmetric and positive definite.
        """


@runtime_checkable
class AdaptingGain(Protocol):
    """An adaptation with its own gain K: x = x + K y, P = (I - K H) P (I - K H)' + K R K'."""

    def adapt_gain(
        self, x: FloatArray, P: FloatArray, innovation: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return K (n, m) instead of P H' S^-1. It is called last.

        The arguments are those of `AdaptingPrior.adapt_prior`, with the adapted P and R, without dropped rows.
        """


# Estimators: filters that are not kinematic


@runtime_checkable
class Estimator(Protocol):
    """Any other filter. It belongs to the group ``filter``, too.

    Optional: `Batched`, `PerSeed`, `Requiring`, `ReadingFile`, `Remarking`, and the optional attributes of a `Filter`.

    Attributes:
        adaptations: names of the accepted adaptations. A sweep leaves out the combinations with others.
    """

    adaptations: ClassVar[tuple[str, ...]]

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the stamps of the reference."""


@runtime_checkable
class Batched(Protocol):
    """An estimator with a compiled implementation, with and without trajectories.

    ``estimate`` is the reference implementation, which the engine `filterpy` runs; an engine that is `SideBySide` runs
    the compiled one. `jerkbench.testing.check_filter` compares them. If a method returns None, ``estimate`` is run
    instead, which raises the error.
    """

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return the same as ``estimate``."""

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
        """Run over all ``runs`` without storing trajectories. An error of one run does not affect the others.

        Args:
            runs: recordings with their attitudes and scoring.
            estimators: one for each run, of the same class.
            adaptations: one for each run, of the same class.
            updates: store the data of the updates.
            attitude: store the attitude, if the estimator has its own.
            threads: number of threads.

        Returns:
            The sums of each run, with `rows_left` if it diverges, or None.
        """


@runtime_checkable
class PerSeed(Protocol):
    """An estimator that is different for each seed, for example a file for each. A sweep runs each seed separately."""

    @property
    def for_each_seed(self) -> bool:
        """True if it has something for each seed. If not, it can run one seed only."""

    def of_seed(self, seed: int) -> Estimator:
        """Return the estimator of ``seed``."""


# Engines


class Engine(Protocol):
    """Runs a kinematic filter with an adaptation. All engines have the same inputs and outputs. Optional: `SideBySide`.

    Optional methods:

    - ``prepare(model: Filter) -> None`` starts to compile in the background what `run` will need.
    - ``announce(methods: Sequence[tuple[Filter | Estimator, Adaptation]]) -> None`` is called before the processes of a
      sweep start, with the filter and the adaptation of each job.
    """

    def run(self, timeline: Timeline, model: Filter, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the stamps of the reference."""


@runtime_checkable
class SideBySide(Protocol):
    """An engine that runs many timelines at once without storing trajectories."""

    def run_settings(
        self,
        runs: Sequence[Run],
        models: Sequence[Filter],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Return the sums of each run, with `rows_left` if it diverges. None: `Engine.run` has to run it.

        An error of one run does not affect the others.

        Args:
            runs: timelines and scoring.
            models: the filter of each run.
            adaptations: the adaptation of each run.
            updates: store the data of the updates.
            threads: number of threads.
        """


# Metrics


class Metric(Protocol):
    """One or several numbers of a run. Optional: `Summarising`.

    If all metrics of a sweep are `Summarising` or have ``reads``, it runs without trajectories and many times faster.

    Optional attributes:

    - ``columns: ClassVar[Mapping[str, Column]]``: titles of the columns, and how they are read. By default the lowest
      value is the best.
    - ``reads: ClassVar[Literal["attitude", "updates"]]``: the metric reads only ``index`` and ``euler_rad`` of the
      estimate, or these and ``updates``.
    - ``default: ClassVar[bool] = True``: if False, the metric is computed only on request (``metrics=[name]``).
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the values by column name (unit included). NaN: the metric does not apply.

        ``counted`` (k,) marks the rows of the estimate that are scored: those with a reference, after the burn-in.
        """


@runtime_checkable
class Summarising(Protocol):
    """A metric that needs only the sums of a run."""

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the same as `Metric.evaluate`, from the sums."""


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
"""The protocol of each kind. A plugin of the kind filter satisfies one of two."""

# Values of optional members, with their defaults

_P = TypeVar("_P")


def has_methods(plugin: object, protocol: type[_P]) -> TypeGuard[_P]:
    """Return whether a plugin has the methods of a protocol without attributes. Faster than `isinstance`."""
    return _has_methods(cast("type", type(plugin)), cast("type", protocol))


@cache
def _has_methods(cls: type, protocol: type) -> bool:
    return issubclass(cls, protocol)


def preferred_attitude(dataset: object) -> str | None:
    """Return the name of the attitude filter that suits a data set or its class."""
    return getattr(dataset, "default_attitude", None)


def is_attitude_only(plugin: object) -> bool:
    """Return whether a data set has no positions, or a filter estimates none."""
    return getattr(plugin, "attitude_only", False) is True


def lacks_imu(dataset: object) -> bool:
    """Return whether the recordings of a data set have no IMU."""
    return bool(getattr(dataset, "without_imu", False))


def uses_imu(model: object) -> bool:
    """Return whether a filter or its class uses the IMU. A class does if its parameters decide this."""
    return getattr(model, "uses_imu", True) is not False


def clocked(adaptation: _P, timeline: Timeline) -> _P:
    """Return ``adaptation`` for the run over ``timeline``: its `at_updates` receives the update times."""
    at_updates = getattr(adaptation, "at_updates", None)
    return at_updates(timeline.update_times_s) if at_updates else adaptation


def empty_memory(adaptation: object, states: int = 6) -> FloatArray:
    """Return the memory of ``adaptation`` at the start of a run with a filter of ``states`` states: zeros."""
    return np.zeros(memory_size(adaptation, states))


def memory_size(adaptation: Any, states: int) -> int:  # noqa: ANN401 - has optional methods
    """Return the length of the memory of ``adaptation`` with a filter of ``states`` states."""
    if hasattr(adaptation, "memory_size_of"):
        return int(adaptation.memory_size_of(states))
    return int(adaptation.memory_size()) if hasattr(adaptation, "memory_size") else 0


def wants_truth(adaptation: object) -> bool:
    """Return whether an adaptation receives the true covariance as R."""
    return bool(getattr(adaptation, "wants_true_covariance", False))


def asked_in_lanes(adaptation: object) -> bool:
    """Return whether an adaptation is called for several runs at once. One that fades is called for each run."""
    return bool(getattr(adaptation, "lanes", False)) and not has_methods(adaptation, Fading)


def changes_nothing(adaptation: object) -> bool:
    """Return whether the class of an adaptation itself declares that R, P and the gain stay as they are."""
    return bool(vars(type(adaptation)).get("changes_nothing", False))


def on_request(metric: object) -> bool:
    """Return whether a metric or its class is computed only on request."""
    return not getattr(metric, "default", True)


def part_read(metric: object) -> Literal["attitude", "updates", "everything"]:
    """Return the part of an estimate that a metric reads."""
    return getattr(metric, "reads", "everything")


def axis_models(model: Filter, lengths_s: FloatArray, dt0_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A (k, n, n), b (k, n), Q (k, n, n) of ``lengths_s`` (k,). Steps that are not positive change nothing."""
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
