"""The search finds what is true, is blind to what it is scored on, goes on where it was, and spends the same."""

import dataclasses
import itertools

import numpy as np
import pandas as pd
import pytest
from linear_gaussian import R_POSITION, R_VELOCITY, SIGMA_A, Level, LinearGaussian

from jerkbench.campaign.outcome import budget_curve, indistinct_intervals
from jerkbench.campaign.runs import CampaignRuns, space_of
from jerkbench.campaign.search import FAILED_RUN, Budget, Evaluator, objective_of, score, search, tune
from jerkbench.campaign.split import Seeds, by_seeds
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.jobs import run as loop
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import job_of_parts
from jerkbench.parameters import RScale
from made_jobs import with_method, with_scenario

TRUTH = {"filter.accel_mps2": SIGMA_A, "r_scale.position": R_POSITION, "r_scale.velocity": R_VELOCITY}
SHORT = LinearGaussian(duration_s=12.0)


def cell_of(dataset=SHORT, model="baseline", adaptation="none", **replaced):
    single = {"dataset": "field", "attitude": None, "filter": model, "adaptation": adaptation, "engine": "compiled"}
    job = job_of_parts(single, ["none"], None, Protocol())
    return with_method(with_scenario(job, dataset=dataset, attitude=Level()), **replaced)


@pytest.fixture
def evaluator_of(tmp_path):
    """Make an evaluator that stores in a folder of its own."""
    numbers = itertools.count()

    def made(cell, objective="rmse", chosen=(), folder=None):
        place = folder or tmp_path / str(next(numbers))
        return Evaluator(space_of(cell, chosen), objective_of(objective), CampaignRuns(place))

    return made


def test_the_likelihood_finds_the_true_noises(evaluator_of):
    cell = cell_of(LinearGaussian())
    evaluator = evaluator_of(cell, "likelihood")

    found = search(evaluator, by_seeds([cell], Seeds(8, 0, 8)), Budget(256))

    for name, value, (low, high) in zip(
        evaluator.space.names, found.setting, indistinct_intervals(evaluator.space, found), strict=True
    ):
        assert value == pytest.approx(TRUTH[name], rel=0.4), name
        assert low <= TRUTH[name] <= high < 12 * low, name
    truth = tuple(TRUTH[name] for name in evaluator.space.names)
    at_truth, chosen = evaluator.trials([truth, found.setting], by_seeds([cell], Seeds(8, 0, 8)).tune).means
    assert at_truth < chosen < at_truth + 0.1


@pytest.mark.parametrize("objective", ["likelihood", "rmse"])
def test_the_truth_lies_in_the_intervals_of_what_cannot_be_told_apart(objective, evaluator_of):
    """An error says nothing of the scale of Q and R together: that of the position is told, the rest is found."""
    cell = cell_of(LinearGaussian(), r_scale=RScale(position=R_POSITION))
    evaluator = evaluator_of(cell, objective, ["filter.accel_mps2", "r_scale.velocity"])

    found = search(evaluator, by_seeds([cell], Seeds(8, 0, 8)), Budget(128))

    for name, value, (low, high) in zip(
        evaluator.space.names, found.setting, indistinct_intervals(evaluator.space, found), strict=True
    ):
        assert low <= TRUTH[name] <= high, (name, value)
        assert high / low < 12, name


class PoisonedError(Exception):
    """A test seed was read."""


@dataclasses.dataclass(frozen=True)
class Guarded(LinearGaussian):
    """Raises where it is asked for a seed that is not to be seen."""

    forbidden: tuple[int, ...] = ()

    def load(self, seed):
        if seed in self.forbidden:
            raise PoisonedError(seed)
        return super().load(seed)


@pytest.mark.parametrize("objective", ["likelihood", "rmse"])
def test_test_data_are_never_read_while_tuning(objective, evaluator_of):
    seeds = Seeds(tune=2, choose=2, test=3)
    cell = cell_of(Guarded(duration_s=12.0, forbidden=seeds.parts[2]))
    cases, evaluator = by_seeds([cell], seeds), evaluator_of(cell, objective)

    found = search(evaluator, cases, Budget(4))

    assert len(found.trials) == 4
    with pytest.raises(JerkbenchError, match="Poisoned"):
        score(evaluator, found.setting, cases.test)


def test_an_interrupted_search_goes_on_where_it_was_with_the_same_result(tmp_path, monkeypatch, evaluator_of):
    cell, tried = cell_of(), []
    cases = by_seeds([cell], Seeds(1, 1, 1))
    original, ran = loop.work, []
    monkeypatch.setattr(loop, "work", lambda task, **how: ran.append(len(task.jobs)) or original(task, **how))
    whole = search(evaluator_of(cell), cases, Budget(40, finalists=2))

    def stop(count):
        tried.append(count)
        if len(tried) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(evaluator_of(cell, folder=tmp_path), cases, Budget(40, finalists=2), stop)
    del ran[:]
    resumed = search(evaluator_of(cell, folder=tmp_path), cases, Budget(40, finalists=2))

    assert tried == [16, 16]
    assert ran == [8, 3]  # the finalists with the plain filter
    assert resumed.setting == whole.setting
    assert np.array_equal(resumed.trials.runs, whole.trials.runs)


def test_the_setting_before_the_search_is_one_of_the_trials_and_another_restart_another_scramble(
    evaluator_of, tmp_path
):
    cell = cell_of()
    cases, evaluator = by_seeds([cell], Seeds(1, 0, 1)), evaluator_of(cell)
    small, large = (search(evaluator, cases, Budget(count)).trials for count in (5, 20))
    assert small.settings[0] == evaluator.space.start == (0.2, 1.0, 1.0)
    assert large.settings[:5] == small.settings
    assert large.means[0] == pytest.approx(0.0)  # the plain filter at its defaults is itself
    assert [size for size, _ in budget_curve(large)] == [1, 4, 16, 20]
    cases = by_seeds([cell], Seeds(1, 0, 2))
    evaluator = Evaluator(space_of(cell), objective_of("rmse"), CampaignRuns(tmp_path))
    tuning = tune("baseline-none", cases, evaluator, Budget(4))
    assert tuning.interval_s == pytest.approx(0.02)


@pytest.mark.parametrize("sampler", ["tpe", "cma_es"])
def test_a_learning_sampler_gives_the_same_settings_again(sampler, evaluator_of):
    pytest.importorskip("optuna")
    cell = cell_of()
    cases = by_seeds([cell], Seeds(1, 0, 1))
    first, second = (search(evaluator_of(cell), cases, Budget(20, sampler)).trials for _ in range(2))

    assert first.settings == second.settings
    assert len(set(first.settings)) == 20


def test_a_lost_run_counts_log_100_and_none_counts_more():
    objective = objective_of("rmse")
    rows = {"status": ["ok", "diverged", "ok", "ok"], "position_rmse_m": [0.5, 2.0, np.nan, 1e9]}
    values = objective.values(pd.DataFrame(rows))

    assert objective.losses(values, 1.0) == pytest.approx([np.log(0.5), FAILED_RUN, FAILED_RUN, FAILED_RUN])
    assert objective.level(values[:2], 1000.0) == pytest.approx(0.5)
    assert objective.level(values[1:2], 1000.0) == pytest.approx(1000.0)


def test_the_best_on_an_edge_is_told_whole_numbers_stay_whole_and_no_range_is_refused():
    with pytest.raises(PluginError, match="no parameter of the filter gnss_only and the adaptation none has a range"):
        space_of(cell_of(model="gnss_only"))
    space = space_of(cell_of())
    assert space.at_edge((9.9, 1.0, 1.0)) == [
        "filter.accel_mps2 = 9.9 lies at the high end of its range (0.01 to 10, logarithmic); the best may lie beyond."
    ]
    assert not space.at_edge(space.start)
    cell = cell_of(model="jerk", adaptation="mtf")
    space = space_of(cell)
    applied = space.applied(cell, space.setting(np.full(len(space.parameters), 0.5)))
    assert applied.method.adaptation.window == 7
    assert isinstance(applied.method.adaptation.window, int)
    assert applied.method.filter.accel_mps2 == pytest.approx(np.sqrt(0.01 * 10.0))
    assert applied.spec["adaptation"]["window"] == 7
