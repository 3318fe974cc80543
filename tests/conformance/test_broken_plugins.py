"""Each check fails on a plugin that is broken in just the way it looks for, with a sentence that says so."""

import dataclasses
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from jerkbench import testing
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.disturbances.imu import ImuBias as BiasDisturbance
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import PluginError
from jerkbench.estimate import Streamed, Updates
from jerkbench.evaluation.metrics.position import PositionRmse
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.filters.kinematic import Jerk
from jerkbench.kinematic.trajectory_score import scored_trajectory
from jerkbench.plugins.samples import small_recording, true_attitude


def fails(kind, plugin, sentence):
    with pytest.raises(AssertionError, match=sentence) as caught:
        getattr(testing, f"check_{kind}")(plugin)
    assert str(caught.value).endswith((".", "1, 0.01."))


def adaptation(adapt, *, size=0, fade=None):
    """An adaptation made of functions."""

    class Broken(NoAdaptation):
        def memory_size(self):
            return size

    Broken.adapt = adapt
    if fade is not None:
        Broken.fade = fade
    return Broken()


class Counting(NoAdaptation):
    """Remembers outside its memory."""

    seen = 0

    def adapt(self, innovation, HPHt, R, rows, memory):
        type(self).seen += 1
        return R * (1.0 + type(self).seen)


def in_place(part):
    def adapt(self, innovation, HPHt, R, rows, memory):
        given = {"innovation": innovation, "HPHt": HPHt, "R": R, "rows": rows}
        given[part][...] = given[part] * 2
        return R.copy()

    return adapt


def asymmetric(self, innovation, HPHt, R, rows, memory):
    return R + np.triu(R, 1) * 0.01


def negative(self, innovation, HPHt, R, rows, memory):
    return R - 0.5 * np.diag(np.minimum(innovation**2, 3 * np.diag(R)))


def indefinite(self, innovation, HPHt, R, rows, memory):
    s = np.sqrt(np.diag(R))
    return np.diag(s**2) if len(s) < 2 else np.outer(s, s) * (1.5 - 0.5 * np.eye(len(s)))


def sometimes_nan(self, innovation, HPHt, R, rows, memory):
    return R * (np.nan if len(rows) == 1 else 1.0)


def poisons_memory(self, innovation, HPHt, R, rows, memory):
    memory[0] = max(memory[0] * 1e3 + 1.0, np.inf if np.abs(innovation).max() > 50 else 0.0)
    return R


ADAPTATIONS = {
    "changes innovation in place": adaptation(in_place("innovation")),
    "changes HPHt in place": adaptation(in_place("HPHt")),
    "changes R in place": adaptation(in_place("R")),
    "changes rows in place": adaptation(in_place("rows")),
    "second run": Counting(),
    "is not symmetric": adaptation(asymmetric),
    "negative variance": adaptation(negative),
    "not positive semidefinite": adaptation(indefinite),
    "NaN as a variance": adaptation(sometimes_nan),
    "shape": adaptation(lambda self, y, HPHt, R, rows, memory: np.diag(R)),
    "must be float64": adaptation(lambda self, y, HPHt, R, rows, memory: R.astype(np.float32)),
    "must be a NumPy array": adaptation(lambda self, y, HPHt, R, rows, memory: R.tolist()),
    "the memory of Broken holds NaN": adaptation(poisons_memory, size=1),
    "must be positive": adaptation(NoAdaptation.adapt, fade=lambda self, *update: 0.0),
    "is inf; it must be positive and finite": adaptation(NoAdaptation.adapt, fade=lambda self, *update: np.inf),
}


def prior_of(change):
    """An adaptation of the prior covariance alone."""
    return type("Broken", (NoAdaptation,), {"adapt_prior": lambda self, x, P, F, *update: change(P, F)})()


def gain_of(change):
    """An adaptation with a gain of its own."""
    return type("Broken", (NoAdaptation,), {"adapt_gain": lambda self, x, P, y, R, rows, memory: change(P[:, rows])})()


def doubled_in_place(P, F):
    F *= 2.0
    return P.copy()


BEYOND_R = {
    r"adapt_prior\(\) has shape": prior_of(lambda P, F: P[:6, :6].copy()),
    r"adapt_prior\(\) is not symmetric": prior_of(lambda P, F: F @ P),
    r"adapt_prior\(\) has a negative variance": prior_of(lambda P, F: -P),
    r"adapt_prior\(\) changes F in place": prior_of(doubled_in_place),
    r"adapt_gain\(\) has shape": gain_of(lambda PHt: PHt.T.copy()),
    r"adapt_gain\(\) holds NaN": gain_of(lambda PHt: PHt * np.nan),
}


class BrokenJerk(Jerk):
    """A jerk filter whose model is spoilt."""

    def __init__(self, spoil, extra=None):
        super().__init__()
        object.__setattr__(self, "spoil", spoil)
        object.__setattr__(self, "extra", extra)

    def axis_model(self, dt, dt0):
        return self.spoil(*super().axis_model(dt, dt0))

    def initial_variances(self):
        return super().initial_variances() if self.extra is None else self.extra


FILTERS = {
    r"A of .* has shape": BrokenJerk(lambda A, b, Q: (A[:2, :2], b, Q)),
    r"b of .* has shape": BrokenJerk(lambda A, b, Q: (A, b[:, None], Q)),
    r"Q of .* has a negative variance": BrokenJerk(lambda A, b, Q: (A, b, -Q)),
    r"Q of .* is not symmetric": BrokenJerk(lambda A, b, Q: (A, b, Q + np.triu(Q, 1))),
    r"holds NaN": BrokenJerk(lambda A, b, Q: (A, b * np.nan, Q)),
    r"must follow velocity": BrokenJerk(lambda A, b, Q: (np.eye(3), b, Q)),
    r"a step of a nanosecond": BrokenJerk(lambda A, b, Q: (A, b, Q + np.diag([0, 0, 1.0]))),
    r"another result the second time": BrokenJerk(
        lambda A, b, Q, seen=[]: (A, b, Q * (1 + len(seen), seen.append(0))[0])
    ),
    r"initial_variances\(\) has a negative": BrokenJerk(lambda *model: model, np.array([-1.0])),
    r"returns the type list; it must be ndarray": BrokenJerk(lambda *model: model, [1.0]),
    r"neither axis_model\(\) nor estimate\(\)": NoAdaptation(),
}


class BrokenEstimator(GnssOnly):
    """An estimator whose result is spoilt."""

    def __init__(self, **changes):
        object.__setattr__(self, "changes", changes)

    def estimate(self, recording, attitude, adaptation):
        estimate = super().estimate(recording, attitude, adaptation)
        changes = {name: change(getattr(estimate, name)) for name, change in self.changes.items()}
        return dataclasses.replace(estimate, **changes)


class Unwilling(GnssOnly):
    """Accepts nothing."""

    adaptations = ()


class Meddling(GnssOnly):
    """Changes the attitude that it is given."""

    def estimate(self, recording, attitude, adaptation):
        attitude.euler_rad[0] += 1.0
        return super().estimate(recording, attitude, adaptation)


ESTIMATORS = {
    "fails on a small recording: tired": BrokenEstimator(failure=lambda _: "tired"),
    "estimates nothing": BrokenEstimator(index=lambda index: index[:0]),
    "do not increase": BrokenEstimator(index=lambda index: index[::-1]),
    "position_m holds NaN": BrokenEstimator(position_m=lambda p: p * np.nan),
    "velocity_mps has shape": BrokenEstimator(velocity_mps=lambda v: v[:, :2]),
    "covariance has shape": BrokenEstimator(covariance=lambda P: P[:, :3, :3]),
    "covariance has a negative variance": BrokenEstimator(covariance=lambda P: -P),
    "must be a tuple of names": Unwilling(),
    "changes its input in place": Meddling(),
}


class BrokenDisturbance(BiasDisturbance):
    """A disturbance made of a function."""

    def __init__(self, apply, seeded=False, replicates=1):
        super().__init__()
        for name, value in {"change": apply, "seeded": seeded, "count": replicates}.items():
            object.__setattr__(self, name, value)

    def apply(self, recording, seed):
        return self.change(recording, seed)

    def replicates(self):
        return self.count


def global_numbers(recording, seed):
    np.random.seed(np.random.randint(10**6))  # noqa: NPY002 - that is the defect
    return recording


def thawing(recording, seed):
    imu = recording.imu
    imu.gyro_radps.flags.writeable = True
    imu.gyro_radps[0] += 1.0
    return recording


DISTURBANCES = {
    "returns the type NoneType; it must be Recording": BrokenDisturbance(lambda recording, seed: None),
    "it is not seeded and has 1 replicates": BrokenDisturbance(lambda r, seed: replace(r, name=f"{r.name} {seed}")),
    "it is not seeded and has 2 replicates": BrokenDisturbance(
        lambda r, seed: replace(r, name=f"{r.name} {seed % 3}"), replicates=2
    ),
    "global random numbers": BrokenDisturbance(global_numbers, seeded=True),
    "another result the second time": BrokenDisturbance(
        lambda r, seed: replace(r, name=str(np.random.default_rng().random())), seeded=True
    ),
    "changes its input in place": BrokenDisturbance(thawing),
    "is 0; it must be an integer, at least 1": BrokenDisturbance(lambda r, seed: r, replicates=0),
    "replicates.. is 1.5": BrokenDisturbance(lambda r, seed: r, replicates=1.5),
    "seeded is 'yes'": BrokenDisturbance(lambda r, seed: r, seeded="yes"),
}


@dataclass(frozen=True)
class Source:
    """A data set made of a function."""

    make: object
    mark: object = ""
    seeded: object = True

    def load(self, seed):
        return self.make(seed)

    def fingerprint(self):
        return self.mark


def numbered(seed):
    return replace(small_recording(6.0), name=str(seed))


DATASETS = {
    "returns the type int; it must be Recording": Source(lambda seed: seed),
    "gives no positions": Source(lambda seed: replace(numbered(seed), position=None)),
    "another result the second time": Source(lambda seed: numbered(np.random.default_rng().random())),
    "returns the type int; it must be str": Source(numbered, mark=7),
    "its seeded is True": Source(lambda seed: numbered(0)),
    "its seeded is False": Source(numbered, seeded=False),
}


class FromReference:
    """An attitude filter that looks at the reference; its result can be spoilt."""

    def __init__(self, **changes):
        self.changes = changes

    def estimate(self, recording):
        attitude = true_attitude(recording)
        return replace(attitude, **{name: change(getattr(attitude, name)) for name, change in self.changes.items()})


ATTITUDES = {
    "t_s must be the stamps": FromReference(t_s=lambda t: t + 0.1),
    "dcm has shape": FromReference(dcm=lambda dcm: dcm[:-1]),
    "euler_rad holds NaN": FromReference(euler_rad=lambda euler: euler * np.nan),
    "matrices that are no rotations": FromReference(dcm=lambda dcm: 1.01 * dcm),
    "are no rotations": FromReference(dcm=lambda dcm: -dcm),
    "dcm is not Rz": FromReference(dcm=lambda dcm: dcm.transpose(0, 2, 1)),
    "type float64; it must be .*, bool": FromReference(triggered=lambda triggered: triggered.astype(float)),
    "triggered has shape": FromReference(triggered=lambda triggered: triggered[:-1]),
}


class Metric:
    """A metric made of a function."""

    def __init__(self, evaluate):
        self.evaluate = evaluate


class Disagreeing(PositionRmse):
    """Its two methods differ."""

    def evaluate(self, estimate, recording, counted):
        return PositionRmse().evaluate(estimate, recording, counted)

    def summarise(self, sums):
        return {name: 1.01 * value for name, value in super().summarise(sums).items()}


def moves_the_estimate(estimate, recording, counted):
    estimate.position_m[0] += 1.0
    return {"a_m": 0.0}


METRICS = {
    "returns no value": Metric(lambda *run: {}),
    "must be dict": Metric(lambda *run: 1.0),
    "must be a float": Metric(lambda *run: {"a_m": "1"}),
    "if fewer rows are scored": Metric(lambda e, r, counted: {"a_m": 0.0} if counted.any() else {}),
    "changes its input in place": Metric(moves_the_estimate),
    r"summarise\(\) returns": Disagreeing(),
}


class BrokenEngine(FilterpyEngine):
    """An engine that adds to the position, or takes another adaptation."""

    def __init__(self, offset_m=0.0, adaptation=None):
        super().__init__()
        object.__setattr__(self, "offset_m", offset_m)
        object.__setattr__(self, "adaptation", adaptation)

    def run(self, timeline, model, adaptation):
        estimate = super().run(timeline, model, self.adaptation or adaptation)
        return replace(estimate, position_m=estimate.position_m + self.offset_m)


ENGINES = {
    "off the reference engine": BrokenEngine(offset_m=1e-5),
    ".* off the reference engine": BrokenEngine(adaptation=NoAdaptation()),
}
BROKEN = [
    *(("adaptation", each) for each in (ADAPTATIONS, BEYOND_R)),
    *(("filter", each) for each in (FILTERS, ESTIMATORS)),
    *(("disturbance", DISTURBANCES), ("dataset", DATASETS), ("attitude", ATTITUDES)),
    *(("metric", METRICS), ("engine", ENGINES)),
]


@pytest.mark.parametrize(("kind", "sentence", "plugin"), [(kind, *each) for kind, of in BROKEN for each in of.items()])
def test_each_check_finds_its_defect(kind, sentence, plugin):
    fails(kind, plugin, sentence)


def drops_all(self, innovation, HPHt, R, rows, memory):
    return np.where(np.eye(len(rows)) > 0, np.inf, R)


RIGHT = [
    *(("adaptation", adaptation(drops_all)), ("attitude", FromReference()), ("metric", PositionRmse())),
    *(("dataset", Source(numbered)), ("dataset", Source(lambda seed: numbered(0), seeded=False))),
]


@pytest.mark.parametrize(("kind", "plugin"), RIGHT)
def test_no_check_finds_a_defect_where_there_is_none(kind, plugin):
    getattr(testing, f"check_{kind}")(plugin)


@dataclass
class Thawed:
    """Not frozen."""


@dataclass(frozen=True)
class Undocumented(Mtf):
    """Has a parameter of which nothing is said."""

    extra: float = 1.0


@dataclass(frozen=True)
class Silent:
    window: int = 1


@dataclass(frozen=True)
class Listed(NoAdaptation):
    """Has a list.

    Attributes:
        items: some numbers.
    """

    items: list = field(default_factory=list)


@dataclass(frozen=True)
class Forgetful(Mtf):
    """Loses its parameters on the way to another process."""

    def __reduce__(self):
        return Forgetful, ()


def local_plugin():
    @dataclass(frozen=True)
    class Local(NoAdaptation):
        """Cannot be found by another process."""

    return Local()


@pytest.mark.parametrize(
    ("plugin", "sentence"),
    [
        (Thawed(), "Thawed is not a frozen dataclass"),
        (Undocumented(), "does not document its parameter extra"),
        (Silent(), "Silent has no docstring"),
        (Listed(), "Listed is not hashable"),
        (local_plugin(), "cannot be pickled"),
        (Forgetful(window=3), "is different after pickling"),
    ],
)
def test_any_plugin(plugin, sentence):
    with pytest.raises(AssertionError, match=sentence):
        testing.check_plugin("adaptation", plugin)


class Careless(Listed):
    """Has three faults

    Attributes:
        items: some numbers.
    """

    def adapt(self, innovation, HPHt, R, rows, memory):
        return np.diag(R)


def test_check_plugin_reports_the_problems_of_the_class_and_of_its_methods():
    with pytest.raises(AssertionError) as caught:
        testing.check_plugin("adaptation", Careless())

    faults = ("has no docstring", "is not hashable", "adapt() has shape")
    for line, words in zip(str(caught.value).splitlines(), faults, strict=True):
        assert words in line


def test_an_unknown_kind_is_a_sentence():
    with pytest.raises(PluginError, match="mean 'adaptation'"):
        testing.check_plugin("adaption", NoAdaptation())


@dataclass(frozen=True)
class BrokenBatched(GnssOnly):
    """An estimator whose compiled way goes another way."""

    apart_m: float = 0.0
    factor: float = 1.0

    def estimate_compiled(self, recording, attitude, adaptation):
        estimate = self.estimate(recording, attitude, adaptation)
        return replace(estimate, position_m=estimate.position_m + self.apart_m)

    def run_settings(self, runs, estimators, adaptations, *, updates, attitude, threads):
        both = zip(estimators, runs, adaptations, strict=True)
        return [None if own.factor == 0.0 else own._sums(run, adaptation) for own, run, adaptation in both]

    def _sums(self, run, adaptation):
        estimate = self.estimate(run.recording, run.attitude, adaptation)
        error = (estimate.position_m - run.scoring.truth[:, :3]) * run.scoring.counted[:, None]
        velocity = (estimate.velocity_mps - run.scoring.truth[:, 3:]) * run.scoring.moving[:, None]
        position_m2, velocity_m2ps2 = (error**2).sum(axis=0) * self.factor, (velocity**2).sum(axis=0)
        none = Updates.empty()
        return Streamed(position_m2, velocity_m2ps2, *[0.0] * 11, np.zeros((0, 3)), np.zeros((0, 6)), none)


def test_a_compiled_way_that_goes_another_way():
    with pytest.raises(AssertionError, match="position_m"):
        testing.check_filter(BrokenBatched(apart_m=1e-3))
    with pytest.raises(AssertionError, match=r"position_m2 of .*run_settings\(\)"):
        testing.check_filter(BrokenBatched(factor=1.1))
    testing.check_filter(BrokenBatched(factor=0.0))


def test_a_compiled_way_that_does_not_say_when_a_run_strays():
    """Its sums are right: they are made from the trajectory."""

    class Silent(GnssOnly):
        def run_settings(self, runs, estimators, adaptations, *, updates, attitude, threads):
            streamed = (self._sums(run, adaptation) for run, adaptation in zip(runs, adaptations, strict=True))
            return [result._replace(strayed_m2=0.0, rows_left=0.0) for result in streamed]

        def _sums(self, run, adaptation):
            return scored_trajectory(self.estimate(run.recording, run.attitude, adaptation), run.scoring)

        def estimate_compiled(self, recording, attitude, adaptation):
            return self.estimate(recording, attitude, adaptation)

    with pytest.raises(AssertionError, match="reports '' for a run that diverged"):
        testing.check_filter(Silent())


def test_an_adaptation_that_changes_something_and_says_that_it_does_not():
    class Lying(NoAdaptation):
        changes_nothing = True

        def adapt(self, innovation, HPHt, R, rows, memory):
            return 4.0 * R

    with pytest.raises(AssertionError, match="changes_nothing"):
        testing.check_adaptation(Lying())
