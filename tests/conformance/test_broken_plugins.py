"""The checks of plugins, on plugins that are broken in one way each, and the check before a run."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from jerkbench import plugins, testing
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.disturbances.imu import ImuBias as BiasDisturbance
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import PluginError
from jerkbench.evaluation.metrics.position import PositionRmse
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.filters.kinematic import Jerk
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.rows import job_rows
from jerkbench.plugins.checks import complaint
from jerkbench.plugins.samples import small_recording, true_attitude
from made_jobs import with_method


def broken(base=object, **members):
    """An object of a class that differs from its base in some members."""
    return type("Broken", (base,), members)()


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


def adapting(adapt, **members):
    return broken(NoAdaptation, adapt=adapt, **members)


def doubled_in_place(self, x, P, F, *update):
    F *= 2.0
    return P.copy()


def prior_of(change):
    """An adaptation of the prior covariance alone."""
    return broken(NoAdaptation, adapt_prior=lambda self, x, P, F, *update: change(P, F))


def gain_of(change):
    """An adaptation with a gain of its own."""
    return broken(NoAdaptation, adapt_gain=lambda self, x, P, y, R, rows, memory: change(P[:, rows]))


ADAPTATIONS = {
    **{f"changes {part} in place": adapting(in_place(part)) for part in ("innovation", "HPHt", "rows")},
    "is not symmetric": adapting(asymmetric),
    "negative variance": adapting(negative),
    "not positive semidefinite": adapting(indefinite),
    "NaN as a variance": adapting(sometimes_nan),
    "must be float64": adapting(lambda self, y, HPHt, R, rows, memory: R.astype(np.float32)),
    "must be a NumPy array": adapting(lambda self, y, HPHt, R, rows, memory: R.tolist()),
    "the memory of Broken holds NaN": adapting(poisons_memory, memory_size=lambda self: 1),
    "must be positive": broken(NoAdaptation, fade=lambda self, *update: 0.0),
    "is inf; it must be positive and finite": broken(NoAdaptation, fade=lambda self, *update: np.inf),
    r"adapt_prior\(\) has shape": prior_of(lambda P, F: P[:6, :6].copy()),
    r"adapt_prior\(\) is not symmetric": prior_of(lambda P, F: F @ P),
    r"adapt_prior\(\) has a negative variance": prior_of(lambda P, F: -P),
    r"adapt_prior\(\) changes F in place": broken(NoAdaptation, adapt_prior=doubled_in_place),
    r"adapt_gain\(\) has shape": gain_of(lambda PHt: PHt.T.copy()),
    r"adapt_gain\(\) holds NaN": gain_of(lambda PHt: PHt * np.nan),
}


def jerk(spoil):
    """A jerk filter whose model is spoilt."""
    return broken(Jerk, axis_model=lambda self, dt, dt0: spoil(*Jerk.axis_model(self, dt, dt0)))


FILTERS = {
    r"A of .* has shape": jerk(lambda A, b, Q: (A[:2, :2], b, Q)),
    r"b of .* has shape": jerk(lambda A, b, Q: (A, b[:, None], Q)),
    r"Q of .* has a negative variance": jerk(lambda A, b, Q: (A, b, -Q)),
    r"Q of .* is not symmetric": jerk(lambda A, b, Q: (A, b, Q + np.triu(Q, 1))),
    r"holds NaN": jerk(lambda A, b, Q: (A, b * np.nan, Q)),
    r"must follow velocity": jerk(lambda A, b, Q: (np.eye(3), b, Q)),
    r"a step of a nanosecond": jerk(lambda A, b, Q: (A, b, Q + np.diag([0, 0, 1.0]))),
    r"another result the second time": jerk(lambda A, b, Q, seen=[]: (A, b, Q * (1 + len(seen), seen.append(0))[0])),
    r"initial_variances\(\) has a negative": broken(Jerk, initial_variances=lambda self: np.array([-1.0])),
    r"returns the type list; it must be ndarray": broken(Jerk, initial_variances=lambda self: [1.0]),
}


def estimator(**changes):
    """An estimator whose result is spoilt."""

    def estimate(self, recording, attitude, adaptation):
        right = GnssOnly.estimate(self, recording, attitude, adaptation)
        return replace(right, **{name: change(getattr(right, name)) for name, change in changes.items()})

    return broken(GnssOnly, estimate=estimate)


class Meddling(GnssOnly):
    """Changes the attitude that it is given."""

    def estimate(self, recording, attitude, adaptation):
        attitude.euler_rad[0] += 1.0
        return super().estimate(recording, attitude, adaptation)


ESTIMATORS = {
    "fails on a small recording: tired": estimator(failure=lambda _: "tired"),
    "estimates nothing": estimator(index=lambda index: index[:0]),
    "do not increase": estimator(index=lambda index: index[::-1]),
    "position_m holds NaN": estimator(position_m=lambda p: p * np.nan),
    "velocity_mps has shape": estimator(velocity_mps=lambda v: v[:, :2]),
    "covariance has shape": estimator(covariance=lambda P: P[:, :3, :3]),
    "covariance has a negative variance": estimator(covariance=lambda P: -P),
    "must be a tuple of names": broken(GnssOnly, adaptations=()),
}


def disturbance(apply, replicates=1, **members):
    members |= {"apply": lambda self, recording, seed: apply(recording, seed), "replicates": lambda self: replicates}
    return broken(BiasDisturbance, **({"seeded": False} | members))


def global_numbers(recording, seed):
    np.random.seed(np.random.randint(10**6))  # noqa: NPY002 - that is the defect
    return recording


def thawing(recording, seed):
    imu = recording.imu
    imu.gyro_radps.flags.writeable = True
    imu.gyro_radps[0] += 1.0
    return recording


DISTURBANCES = {
    "returns the type NoneType; it must be Recording": disturbance(lambda recording, seed: None),
    "it is not seeded and has 1 replicates": disturbance(lambda r, seed: replace(r, name=f"{r.name} {seed}")),
    "it is not seeded and has 2 replicates": disturbance(
        lambda r, seed: replace(r, name=f"{r.name} {seed % 3}"), replicates=2
    ),
    "global random numbers": disturbance(global_numbers, seeded=True),
    "another result the second time": disturbance(
        lambda r, seed: replace(r, name=str(np.random.default_rng().random())), seeded=True
    ),
    "changes its input in place": disturbance(thawing),
    "is 0; it must be an integer, at least 1": disturbance(lambda r, seed: r, replicates=0),
    "replicates.. is 1.5": disturbance(lambda r, seed: r, replicates=1.5),
    "seeded is 'yes'": disturbance(lambda r, seed: r, seeded="yes"),
}


def dataset(load, mark="", seeded=True):
    return broken(load=lambda self, seed: load(seed), fingerprint=lambda self: mark, seeded=seeded)


def numbered(seed):
    return replace(small_recording(6.0), name=str(seed))


DATASETS = {
    "returns the type int; it must be Recording": dataset(lambda seed: seed),
    "gives no positions": dataset(lambda seed: replace(numbered(seed), position=None)),
    "another result the second time": dataset(lambda seed: numbered(np.random.default_rng().random())),
    "returns the type int; it must be str": dataset(numbered, mark=7),
    ".seeded is True": dataset(lambda seed: numbered(0)),
    ".seeded is False": dataset(numbered, seeded=False),
}


def attitude(**changes):
    """An attitude filter that reads the reference; its result can be spoilt."""

    def estimate(self, recording):
        right = true_attitude(recording)
        return replace(right, **{name: change(getattr(right, name)) for name, change in changes.items()})

    return broken(estimate=estimate)


ATTITUDES = {
    "t_s must be the stamps": attitude(t_s=lambda t: t + 0.1),
    "dcm has shape": attitude(dcm=lambda dcm: dcm[:-1]),
    "euler_rad holds NaN": attitude(euler_rad=lambda euler: euler * np.nan),
    "matrices that are not rotations": attitude(dcm=lambda dcm: 1.01 * dcm),
    "are not rotations": attitude(dcm=lambda dcm: -dcm),
    "dcm is not Rz": attitude(dcm=lambda dcm: dcm.transpose(0, 2, 1)),
    "type float64; it must be .*, bool": attitude(triggered=lambda triggered: triggered.astype(float)),
    "triggered has shape": attitude(triggered=lambda triggered: triggered[:-1]),
}


def moves_the_estimate(self, estimate, recording, counted):
    estimate.position_m[0] += 1.0
    return {"a_m": 0.0}


METRICS = {
    "returns no value": broken(evaluate=lambda self, *run: {}),
    "must be dict": broken(evaluate=lambda self, *run: 1.0),
    "must be a float": broken(evaluate=lambda self, *run: {"a_m": "1"}),
    "if fewer rows are scored": broken(evaluate=lambda self, e, r, counted: {"a_m": 0.0} if counted.any() else {}),
    "changes its input in place": broken(evaluate=moves_the_estimate),
    r"summarise\(\) returns": broken(
        PositionRmse,
        evaluate=lambda self, *run: PositionRmse().evaluate(*run),
        summarise=lambda self, sums: {name: 1.01 * value for name, value in PositionRmse.summarise(self, sums).items()},
    ),
}


def engine(offset_m=0.0, adaptation=None):
    """An engine that adds to the position, or takes another adaptation."""

    def run(self, timeline, model, given):
        estimate = FilterpyEngine.run(self, timeline, model, adaptation or given)
        return replace(estimate, position_m=estimate.position_m + offset_m)

    return broken(FilterpyEngine, run=run)


ENGINES = {
    "off the reference engine": engine(offset_m=1e-5),
    ".* off the reference engine": engine(adaptation=NoAdaptation()),
}
BROKEN = [
    *(("adaptation", ADAPTATIONS), ("filter", FILTERS), ("filter", ESTIMATORS), ("disturbance", DISTURBANCES)),
    *(("dataset", DATASETS), ("attitude", ATTITUDES), ("metric", METRICS), ("engine", ENGINES)),
]


@pytest.mark.parametrize(("kind", "sentence", "plugin"), [(kind, *each) for kind, of in BROKEN for each in of.items()])
def test_each_check_finds_its_defect(kind, sentence, plugin):
    with pytest.raises(AssertionError, match=sentence) as caught:
        getattr(testing, f"check_{kind}")(plugin)
    assert str(caught.value).endswith((".", "1, 0.01."))


def drops_all(self, innovation, HPHt, R, rows, memory):
    return np.where(np.eye(len(rows)) > 0, np.inf, R)


RIGHT = [
    *(("adaptation", adapting(drops_all)), ("attitude", attitude()), ("metric", PositionRmse())),
    *(("dataset", dataset(numbered)), ("dataset", dataset(lambda seed: numbered(0), seeded=False))),
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


def test_an_adaptation_that_changes_something_and_says_that_it_does_not():
    with pytest.raises(AssertionError, match="changes_nothing"):
        testing.check_adaptation(adapting(lambda self, y, HPHt, R, rows, memory: 4.0 * R, changes_nothing=True))


@dataclass(frozen=True)
class Plain:
    """R as it is; no memory_size."""

    def adapt(self, innovation, HPHt, R, rows, memory):
        return R


class InPlace(Plain):
    """Changes R where it lies."""

    def adapt(self, innovation, HPHt, R, rows, memory):
        R *= 4.0
        return R


class Growing(Plain):
    """Counts on itself."""

    def adapt(self, innovation, HPHt, R, rows, memory):
        object.__setattr__(self, "n", getattr(self, "n", 0) + 1)
        return R * (1.0 + 0.01 * self.n)


class Slim(Plain):
    """Returns the diagonal alone."""

    def adapt(self, innovation, HPHt, R, rows, memory):
        return np.diag(R)


@dataclass(frozen=True)
class Empty:
    """Has nothing."""


@dataclass(frozen=True)
class OneSided:
    """Has no initial variances."""

    def axis_model(self, dt, dt0):
        return np.eye(2), np.zeros(2), np.eye(2)


SENTENCES = [
    ("adaptation", Listed(), "Listed is not hashable"),
    ("adaptation", InPlace(), r"InPlace.adapt\(\) changes R in place; it must work on a copy"),
    ("adaptation", Growing(), "Growing gives another result in a second run .* must be in memory"),
    ("adaptation", Slim(), r"Slim.adapt\(\) has shape \(6,\); it must be \(6, 6\)"),
    ("adaptation", Empty(), r"Empty has no method adapt\(\); an adaptation needs it"),
    ("filter", Empty(), r"Empty has neither axis_model\(\) nor estimate\(\)"),
    ("filter", OneSided(), r"OneSided has no method initial_variances\(\); a kinematic filter needs it"),
    ("filter", Meddling(), r"Meddling.estimate\(\) changes its input in place"),
    ("disturbance", Empty(), r"Empty has no method apply\(\); a disturbance needs it"),
    ("metric", Empty(), r"Empty has no method evaluate\(\); a metric needs it"),
    ("attitude", Empty(), r"Empty has no method estimate\(\); an attitude needs it"),
    ("dataset", Empty(), r"Empty has no method load\(\); a dataset needs it"),
    ("engine", Empty(), r"Empty has no method run\(\); an engine needs it"),
]


@pytest.mark.parametrize(("kind", "plugin", "sentence"), SENTENCES)
def test_the_probe_and_the_check_say_the_same(kind, plugin, sentence):
    with pytest.raises(AssertionError, match=sentence) as checked:
        testing.check_plugin(kind, plugin)
    assert complaint(kind, plugin).partition(" (")[0] == str(checked.value).partition(" (")[0]


def cell_with(adaptation):
    spec = {kind: {"name": name} for kind, name in (("filter", "baseline"), ("engine", "filterpy"))}
    spec |= {"dataset": {"name": "field", "duration_s": 12.0}, "attitude": {"name": "gyro_only"}, "disturbance": []}
    return with_method(build({**spec, "adaptation": {"name": "none"}}, Protocol(seeds=2)), adaptation=adaptation)


@pytest.mark.parametrize("adaptation", [InPlace(), Growing(), Slim()])
def test_it_is_said_before_the_run_and_every_seed_is_a_row_that_says_so(adaptation):
    cell = cell_with(adaptation)
    rows, _ = job_rows(cell)

    assert [row["status"] for row in rows] == ["failed", "failed"]
    assert {row["reason"] for row in rows} == {complaint("adaptation", adaptation)}
    with pytest.raises(PluginError, match=type(adaptation).__name__):
        job_rows(cell, strict=True)


def test_one_without_memory_size_runs_on_the_reference_engine():
    rows, _ = job_rows(cell_with(Plain()))
    assert [row["status"] for row in rows] == ["ok", "ok"]


def test_a_missing_method_is_refused_before_anything_runs(monkeypatch):
    monkeypatch.setitem(plugins._registry["disturbance"], "empty", Empty)
    spec = {kind: {"name": name} for kind, name in (("filter", "baseline"), ("engine", "compiled"))}
    spec |= {"dataset": {"name": "field"}, "attitude": {"name": "tilt"}, "adaptation": {"name": "none"}}
    with pytest.raises(PluginError, match=r"Empty has no method apply\(\)"):
        build({**spec, "disturbance": [{"name": "empty"}]}, Protocol())
