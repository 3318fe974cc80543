"""A plugin from elsewhere is looked at before it runs; wrong numbers in silence become a sentence."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from test_broken_plugins import Meddling

from jerkbench import plugins, testing
from jerkbench.adaptation.mtf import Mtf
from jerkbench.disturbances.imu import ImuBias
from jerkbench.errors import PluginError
from jerkbench.evaluation.metrics.position import PositionRmse
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.filters.kinematic import Jerk
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.rows import job_rows
from jerkbench.plugins.checks import complaint
from made_jobs import with_method


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


class Rough(Jerk):
    """Gives a matrix of another size."""

    def axis_model(self, dt, dt0):
        A, b, Q = super().axis_model(dt, dt0)
        return A, b[:2], Q


class Shaken(ImuBias):
    """Another result each time."""

    def apply(self, recording, seed):
        return replace(recording, name=str(np.random.default_rng().random()))


class Wordy(PositionRmse):
    """A metric that gives words."""

    def evaluate(self, estimate, recording, counted):
        return {"position_rmse_m": "small"}


@dataclass(frozen=True)
class Listless(Plain):
    """Has a list."""

    items: tuple = ()
    __hash__: ClassVar[None] = None


SENTENCES = [
    ("adaptation", InPlace(), r"InPlace.adapt\(\) changes R in place; it must work on a copy"),
    ("adaptation", Growing(), "Growing gives another result in a second run .* must be in memory"),
    ("adaptation", Slim(), r"Slim.adapt\(\) has shape \(6,\); it must be \(6, 6\)"),
    ("adaptation", Empty(), r"Empty has no method adapt\(\); an adaptation needs it"),
    ("filter", Empty(), r"Empty has neither axis_model\(\) nor estimate\(\)"),
    ("filter", OneSided(), r"OneSided has no method initial_variances\(\); a kinematic filter needs it"),
    ("filter", Rough(), r"b of Rough.axis_model\(.*\) has shape \(2,\); it must be \(3,\)"),
    ("filter", Meddling(), r"Meddling.estimate\(\) changes its input in place"),
    ("disturbance", Empty(), r"Empty has no method apply\(\); a disturbance needs it"),
    ("disturbance", Shaken(), r"Shaken.apply\(\) gives another result the second time"),
    ("metric", Empty(), r"Empty has no method evaluate\(\); a metric needs it"),
    ("metric", Wordy(), "position_rmse_m is 'small'; it must be a float"),
    ("attitude", Empty(), r"Empty has no method estimate\(\); an attitude needs it"),
    ("dataset", Empty(), r"Empty has no method load\(\); a dataset needs it"),
    ("engine", Empty(), r"Empty has no method run\(\); an engine needs it"),
]


@pytest.mark.parametrize(("kind", "plugin", "sentence"), SENTENCES)
def test_the_probe_and_the_check_say_the_same(kind, plugin, sentence):
    with pytest.raises(AssertionError, match=sentence) as checked:
        testing.check_plugin(kind, plugin)
    assert complaint(kind, plugin).partition(" (")[0] == str(checked.value).partition(" (")[0]


RIGHT = [("adaptation", Plain()), ("adaptation", Mtf()), ("filter", Jerk()), ("filter", Eskf15())]


UNHASHED = ("adaptation", Listless(), "Listless is not hashable")


@pytest.mark.parametrize(("kind", "plugin", "said"), [*((*each, "") for each in RIGHT), UNHASHED])
def test_one_that_is_right_passes_and_one_that_cannot_be_hashed_is_a_sentence(kind, plugin, said):
    assert complaint(kind, plugin).startswith(said)
    assert bool(complaint(kind, plugin)) == bool(said)


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
