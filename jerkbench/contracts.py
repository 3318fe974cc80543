"""The contracts of the plugins, kind by kind. A plugin need not inherit from these; it only has to fit.

Each kind (`Dataset`, `Disturbance`, `AttitudeFilter`, `Filter` (kinematic), `Estimator` (any other filter),
`Adaptation`, `Engine`, `Metric`) has one contract, and behind it its optional parts, each a Protocol of its own; those
that several kinds may have come first. `jerkbench.plugins.optional` lists them. A plugin that has an optional part is
asked for it; one whose part is misspelt is refused when it is registered.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import ClassVar, Literal, Protocol, Self, runtime_checkable

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Attitude, Estimate
from jerkbench.parameters import Column, Provenance
from jerkbench.recording import Recording
from jerkbench.sums import RecordedRun, Run, Streamed, Sums
from jerkbench.timeline import Timeline

# Optional parts of several kinds.


@runtime_checkable
class AttitudeOnly(Protocol):
    """A data set with nothing to navigate by, or a filter that runs over it all the same, if the attribute is True."""

    attitude_only: bool


@runtime_checkable
class ReadingFile(Protocol):
    """A disturbance, or a filter, that reads a file, whose content then stands in the key of a result."""

    def fingerprint(self) -> str:
        """Return a hash of the file's content; empty where this package's own code answers for it."""


@runtime_checkable
class Requiring(Protocol):
    """An attitude filter, or a filter, that does not take every recording."""

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before a sweep begins, that the recording that ``load`` returns has what the parameters ask for.

        Raises:
            RecordingError: it has not.
        """


@runtime_checkable
class Remarking(Protocol):
    """An attitude filter, or a filter, that has something to say of what it makes of a recording."""

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return sentences that a reader of the table has to know, without numbers that change from seed to seed."""


@runtime_checkable
class Cited(Protocol):
    """A plugin of any kind that brings its own BibTeX entries; without them the DOIs of its docstring are cited."""

    citations: ClassVar[tuple[str, ...]]


@runtime_checkable
class Depending(Protocol):
    """A plugin of any kind that names what it reads besides its code, so that a change of it is seen.

    Attributes:
        depends_on: files and folders, seen from the folder of its module, and environment variables as "$NAME".
    """

    depends_on: ClassVar[tuple[str, ...]]


@runtime_checkable
class Classified(Protocol):
    """A filter or an adaptation that says what it is: as published, simplified, or its author's own."""

    provenance: ClassVar[Provenance]


# Data sets.


class Dataset(Hashable, Protocol):
    """A source of recordings; optional: `PreferringAttitude`, `AttitudeOnly`, `WithoutImu`.

    Attributes:
        seeded: whether another seed gives another recording (a simulation) or not (a file).
    """

    seeded: ClassVar[bool]

    def load(self, seed: int) -> Recording:
        """Return the recording; of a simulation, the one that belongs to ``seed``."""

    def fingerprint(self) -> str:
        """Return a hash of the data that `load` reads besides the parameters; empty where it reads none."""


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


# Disturbances.


class Disturbance(Hashable, Protocol):
    """A change of a recording; optional: `ReadingFile`.

    Attributes:
        seeded: whether it draws random numbers.
    """

    seeded: ClassVar[bool]

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the disturbed recording. Random numbers come from `jerkbench.random_streams.stream` alone."""

    def replicates(self) -> int:
        """Return how many different results seeds 0, 1, 2, ... give without any randomness (phases of a decimation)."""


# Attitude filters.


class AttitudeFilter(Hashable, Protocol):
    """A way to find the attitude; optional: `Requiring`, `Remarking`."""

    def estimate(self, recording: Recording) -> Attitude:
        """Return the attitude and the gravity-compensated acceleration at the IMU's stamps."""


# Kinematic filters.


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

    def initial_variances(self) -> FloatArray:
        """Return (n - 2,) initial variances of the states after position and velocity, the same for each axis."""


@runtime_checkable
class ManyLengths(Protocol):
    """What a kinematic filter may have as well, so that uneven stamps are quick: its models of many lengths at once."""

    def axis_models(self, dt: FloatArray, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (k, n, n), b (k, n), Q (k, n, n) for steps of ``dt`` (k,) seconds, as ``axis_model`` has each."""


@runtime_checkable
class UsingImu(Protocol):
    """A filter that says whether it uses the IMU: if not (its b is zero), it runs over recordings without one too."""

    @property
    def uses_imu(self) -> bool:
        """Whether it does; a filter that does not say does."""


@runtime_checkable
class Labelled(Protocol):
    """A filter that has another name in tables than its plugin's: one plugin stands for many methods."""

    @property
    def table_label(self) -> str:
        """What tables call it."""


# Adaptations: rules on R.


class Adaptation(Protocol):
    """A rule that changes R between predict and update.

    Optional: `Remembering`, `Fading`, `Clocked`, `TrueCovariance`; to change more than R, `AdaptingPrior` and
    `AdaptingGain`.
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


@runtime_checkable
class Remembering(Protocol):
    """An adaptation that remembers something from one update to the next."""

    def memory_size(self) -> int:
        """Return the length of the memory that `adapt` gets; without this method there is none."""


@runtime_checkable
class RememberingStates(Protocol):
    """An adaptation whose memory depends on how many states the filter has; in place of `Remembering`."""

    def memory_size_of(self, states: int) -> int:
        """Return the length of the memory over a filter of ``states`` states."""


@runtime_checkable
class Clocked(Protocol):
    """An adaptation with a parameter in seconds: before a run it hears when the updates are, and may count them."""

    def at_updates(self, since_start_s: FloatArray) -> Self:
        """Return the adaptation for a run whose updates are at these times (m,), seconds since its start."""


@runtime_checkable
class TrueCovariance(Protocol):
    """An adaptation that gets the true covariance as R, if the attribute is True: an oracle."""

    wants_true_covariance: ClassVar[bool]


@runtime_checkable
class InLanes(Protocol):
    """An adaptation that many runs ask at once, if the attribute is True; `jerkbench.compilation.lanes` says how.

    It may not branch on what it is given: numbers are vectors then, one number of each run. One that fades is asked by
    each run all the same.
    """

    lanes: ClassVar[bool]


@runtime_checkable
class Varying(Protocol):
    """An adaptation `InLanes` that names whole numbers of its own of which each run may have another.

    They may be reckoned with and go into `chosen` and `each_run`. In the others all runs are alike: loops may use them.
    """

    varying: ClassVar[tuple[str, ...]]


@runtime_checkable
class ChangingNothing(Protocol):
    """An adaptation that leaves R, P and the gain as they are, if the attribute is True: compiled runs do not ask.

    It counts for the class that states it, and not for those that are made from it.
    """

    changes_nothing: ClassVar[bool]


# Adaptations that change more than R: the prior covariance, the gain.


@runtime_checkable
class Fading(Protocol):
    """An adaptation that fades P as well, all of it by one number; each element by its own: `AdaptingPrior`."""

    def fade(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> float:
        """Return the factor on the prior covariance; it is asked first, and `adapt` then sees the faded HPHt.

        Arguments are those of `Adaptation.adapt`.
        """


@runtime_checkable
class AdaptingPrior(Protocol):
    """An adaptation that changes the prior covariance, each element for itself: P and Q, or prior and R at once."""

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

        It is asked after `Fading.fade` and before `Adaptation.adapt`, which then sees the changed H P H'; what it finds
        out about R it leaves in the memory for `adapt`. F and Q are those of all steps since the update before, P+ its
        posterior (at the first update the start): P = F P+ F' + Q unless P was faded.

        Args:
            x: (n,) prior state. Position and velocity come first: H x is ``x[rows]``, H P H' ``P[rows][:, rows]``.
            P: (n, n) its covariance.
            F: (n, n) transition since the update before.
            Q: (n, n) process noise since then.
            innovation: as in `adapt`, like the rest.
            R: likewise.
            rows: likewise.
            memory: likewise; its length may depend on n (`RememberingStates`).

        Returns:
            (n, n), symmetric and positive definite.
        """


@runtime_checkable
class AdaptingGain(Protocol):
    """An adaptation with a gain K of its own: x = x + K y, P = (I - K H) P (I - K H)' + K R K'."""

    def adapt_gain(
        self, x: FloatArray, P: FloatArray, innovation: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return K (n, m), in place of P H' S^-1; it is asked last.

        Arguments are those of `AdaptingPrior.adapt_prior`, P and R as adapted, without the rows that were dropped.
        """


# Estimators: filters that are no kinematic ones.


@runtime_checkable
class Estimator(Protocol):
    """Anything that is not a kinematic filter; it stands in the group ``filter`` too."""

    adaptations: ClassVar[tuple[str, ...]]
    """Names of the adaptations that it accepts; a sweep leaves the others out."""

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""


@runtime_checkable
class Batched(Protocol):
    """What an estimator may have as well, so that it is quick: a compiled way, with and without trajectories.

    ``estimate`` stays the definition of right, and what the engine `filterpy` runs; an engine that is `SideBySide`
    takes the compiled way. `jerkbench.testing.check_filter` compares the two. Of both methods None means: not in this
    way, run ``estimate``, which says what is the matter.
    """

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return what ``estimate`` returns."""

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
        """Run over all ``runs`` without keeping trajectories; what one raises harms no other.

        Args:
            runs: recordings with their attitudes, and what the errors count for.
            estimators: that of each run; they are of one class, and differ in their numbers.
            adaptations: that of each run, likewise.
            updates: whether to keep what the updates saw.
            attitude: whether to keep the attitude, where the estimator finds one of its own.
            threads: how many to use.

        Returns:
            The sums of each run, with `rows_left` if it strays, or None.
        """


@runtime_checkable
class PerSeed(Protocol):
    """What an estimator may have as well: it is another for each seed, of which a sweep runs each on its own."""

    @property
    def for_each_seed(self) -> bool:
        """Whether it has something for each seed; if not, a cell of several seeds makes no sense."""

    def of_seed(self, seed: int) -> Estimator:
        """Return the one of ``seed``."""


# Engines.


class Engine(Protocol):
    """A way to run a kinematic filter with an adaptation; all engines have the same inputs and outputs.

    Optional: `SideBySide`, `Preparing`; `jerkbench.engines.compiled_engine` has both.
    """

    def run(self, timeline: Timeline, model: Filter, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""


@runtime_checkable
class SideBySide(Protocol):
    """An engine that runs many timelines at once, without keeping trajectories; what one raises harms no other."""

    def run_settings(
        self,
        runs: Sequence[Run],
        models: Sequence[Filter],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Return the sums of each run, `rows_left` if it strays; None: `Engine.run` is to run it, and says why.

        Args:
            runs: timelines, and what the errors count for.
            models: the filter of each run.
            adaptations: the adaptation of each run.
            updates: whether to keep what the updates saw.
            threads: how many to use.
        """


@runtime_checkable
class Preparing(Protocol):
    """An engine that can begin with what `Engine.run` will need, while a single run does something else."""

    def prepare(self, model: Filter) -> None:
        """Begin with it."""


# Metrics.


class Metric(Protocol):
    """A number, or a few, from one run; optional: `Declaring`, `Summarising`, `Reading`, `OnRequest`.

    A cell all of whose metrics are `Summarising` or `Reading` runs without storing trajectories, which is many times
    faster.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the values by column name (unit included); NaN where it does not apply.

        ``counted`` (k,) says which rows of the estimate count: the reference is scored there, after the burn-in.
        """


@runtime_checkable
class Declaring(Protocol):
    """A metric that says how its columns are read; of one that it leaves out the lowest is the best."""

    columns: ClassVar[Mapping[str, Column]]


@runtime_checkable
class Summarising(Protocol):
    """A metric that needs no more of a run than its sums."""

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return what `Metric.evaluate` does, from sums over the run alone."""


@runtime_checkable
class Reading(Protocol):
    """A metric that looks at less than all of the estimate: ``index`` and ``euler_rad``, or these and ``updates``."""

    reads: ClassVar[Literal["attitude", "updates"]]


@runtime_checkable
class OnRequest(Protocol):
    """A metric that is only computed where it is asked for (``metrics=[name]``), if the attribute is False."""

    default: ClassVar[bool]
