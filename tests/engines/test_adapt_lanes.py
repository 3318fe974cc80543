"""Adaptations that many runs ask at once, against each run by itself."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from test_side_by_side import BURN_IN_S, assert_same, one, side_by_side, trajectory

from jerkbench import plugins
from jerkbench.adaptation.chi2 import Chi2Gate
from jerkbench.adaptation.iae import InnovationBased
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.mtf_block import MtfBlock
from jerkbench.adaptation.mtf_nis import MtfNis
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.adaptation.relaxing_gate import RelaxingGate
from jerkbench.adaptation.variational_bayes import VariationalBayes
from jerkbench.adaptation.vbakf_pr import VariationalPriorAndNoise
from jerkbench.compilation.lanes import above, chosen
from jerkbench.contracts import asked_in_lanes
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.evaluation.evaluated_run import prepare_reference
from jerkbench.filters.kinematic import Baseline, Jerk
from jerkbench.kinematic.plugin_call import compiled_rule
from jerkbench.sums import Run


@pytest.fixture(scope="module")
def rough():
    """Runs of the same steps, of which some lack velocities for a while."""
    return [one(seed) for seed in range(6)]


def test_the_methods_that_are_asked_at_once():
    lanes = {name for name in plugins.names("adaptation") if asked_in_lanes(plugins.get("adaptation", name))}

    assert lanes >= {
        "student_t",
        "huber",
        "vbakf_pr",
        "variational_bayes",
        "cerkf_r",
        "maximum_correntropy",
        "maximum_correntropy_r",
        "sif",
        "ssmkf",
        "ssmkf_r",
        "mtf",
        "mtf_block",
        "mtf_nis",
        "iae",
        "chi2",
        "relaxing_gate",
    }


@dataclass(frozen=True)
class Unasked(NoAdaptation):
    """Says that it leaves R as it is, and would not."""

    changes_nothing: ClassVar[bool] = True

    def adapt(self, innovation, HPHt, R, rows, memory):
        return 4.0 * R


def test_who_says_that_nothing_changes_is_not_asked(rough):
    """Neither alone nor side by side."""
    plain, unasked = (CompiledEngine().run(rough[0][1], Jerk(), rule) for rule in (NoAdaptation(), Unasked()))
    np.testing.assert_array_equal(unasked.covariance, plain.covariance)
    (plain,), (unasked,) = (side_by_side(rough[:1], Jerk(), [rule]) for rule in (NoAdaptation(), Unasked()))
    np.testing.assert_array_equal(list(unasked.values()), list(plain.values()))


@pytest.mark.parametrize("cls", [VariationalBayes, pytest.param(VariationalPriorAndNoise, marks=pytest.mark.slow)])
def test_each_run_has_its_own_numbers_and_its_own_memory(rough, cls):
    rules = [cls(forgetting=value) for value in (0.999, 0.99, 0.98, 0.95, 0.9, 0.8)]

    together = side_by_side(rough, Jerk(), rules)
    backwards = side_by_side(rough[::-1], Jerk(), rules[::-1])[::-1]

    assert len({tuple(result.values()) for result in together}) == len(rules)
    for a, b, pair, rule in zip(together, backwards, rough, rules, strict=True):
        np.testing.assert_array_equal(list(a.values()), list(b.values()))
        assert_same(a, trajectory(*pair, Jerk(), rule), {})


@pytest.mark.parametrize("cls", [Mtf, MtfNis, MtfBlock, InnovationBased])
def test_runs_of_other_windows_are_asked_at_once_all_the_same(rough, cls):
    rules = [cls(window=window) for window in (1, 2, 3, 7, 30, 4)]
    if cls is not InnovationBased:
        rules = [replace(rule, guard=guard) for rule, guard in zip(rules, (0, 1, 0, 2, 0, 5), strict=True)]

    together = {compiled_rule(rule, side_by_side=True).together for rule in rules}

    assert len(together) == 1
    assert None not in together
    for got, pair, rule in zip(side_by_side(rough, Jerk(), rules), rough, rules, strict=True):
        assert_same(got, trajectory(*pair, Jerk(), rule), {})


@pytest.mark.parametrize(
    "make",
    [
        lambda: [Chi2Gate(probability=p, longest=n) for p, n in ((0.9, 0), (0.5, 1), (0.2, 3), (0.2, 25), (0.99, 2))],
        lambda: [RelaxingGate(width=w, patience=n) for w, n in ((1.0, 0), (0.5, 1), (0.2, 3), (0.7, 25), (3.0, 2))],
    ],
)
def test_gates_of_other_lengths_are_asked_at_once_all_the_same(rough, make):
    rules = make()

    together = {compiled_rule(rule, side_by_side=True).together for rule in rules}

    assert len(together) == 1
    assert None not in together
    for got, pair, rule in zip(side_by_side(rough[:5], Jerk(), rules), rough, rules, strict=False):
        assert_same(got, trajectory(*pair, Jerk(), rule), {})


def test_runs_with_other_whole_numbers_go_apart(rough):
    rules = [VariationalBayes(passes=passes) for passes in (1, 2, 5)]

    for got, pair, rule in zip(side_by_side(rough[:3], Jerk(), rules), rough, rules, strict=False):
        assert_same(got, trajectory(*pair, Jerk(), rule), {})


@pytest.fixture(scope="module")
def uneven():
    """Eleven runs whose updates lack now a position, now a velocity; some have half as many as their neighbours."""
    rng, pairs = np.random.default_rng(5), []
    for seed in range(11):
        recording, timeline = one(seed)
        z = timeline.measurements.z.copy()
        z[rng.random(len(z)) < 0.3, :3] = np.nan
        z[rng.random(len(z)) < 0.3, 3:] = np.nan
        z[1 :: 2 if seed % 3 == 0 else len(z)] = np.nan
        pairs.append((recording, replace(timeline, measurements=replace(timeline.measurements, z=z))))
    return pairs


@pytest.mark.parametrize("consistency", [True, False])
@pytest.mark.parametrize("cls", [Mtf, InnovationBased])
def test_a_run_remembers_its_own_updates_whatever_its_neighbours_lack(uneven, cls, consistency):
    windows = (1, 2, 3, 7, 30, 4, 5, 2, 9, 1, 3)
    rules = [cls(window=window) for window in windows]
    if cls is Mtf:
        rules = [replace(rule, guard=k % 3) for k, rule in enumerate(rules)]
    prepared = [prepare_reference(*pair, BURN_IN_S) for pair in uneven]
    runs = [
        Run(timeline, p.scoring if consistency else p.errors_alone)
        for (_, timeline), p in zip(uneven, prepared, strict=True)
    ]
    together = CompiledEngine().run_settings(runs, [Jerk()] * 11, rules, updates=False, threads=1)

    for got, run, rule in zip(together, runs, rules, strict=True):
        (alone,) = CompiledEngine().run_settings([run], [Jerk()], [rule], updates=False, threads=1)
        np.testing.assert_array_equal(got.position_m2, alone.position_m2)
        np.testing.assert_array_equal(got.nees, alone.nees)
    for got, (recording, timeline), rule in zip(together, uneven, rules, strict=True):
        wanted = trajectory(recording, timeline, Jerk(), rule)
        rmse_m = np.sqrt(got.whole_m2 / prepared[0].numbers.whole)
        assert rmse_m == pytest.approx(wanted["position_rmse_whole_m"], rel=1e-9)


@dataclass(frozen=True)
class Bounded(NoAdaptation):
    """Finds no answer where the innovation is too large; drops what is too large for it by half."""

    limit: float = 1e9
    lanes: ClassVar[bool] = True

    def adapt(self, innovation, HPHt, R, rows, memory):
        adapted = R.copy()
        for i in range(len(rows)):
            size = abs(innovation[i])
            adapted[i, i] = chosen(2.0 * size, self.limit, np.inf, R[i, i]) + 0.0 * above(self.limit, size)
        return adapted


def test_a_run_without_an_answer_is_lost_and_harms_no_other(rough):
    rules = [Bounded(), Bounded(0.3), Bounded(1e8)]

    healthy, lost, other = side_by_side(rough[:3], Baseline(), rules)

    assert lost is None
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        CompiledEngine().run(rough[1][1], Baseline(), rules[1])
    for got, pair in ((healthy, rough[0]), (other, rough[2])):
        assert_same(got, trajectory(*pair, Baseline(), NoAdaptation()), {})


@dataclass(frozen=True)
class Branches(NoAdaptation):
    """Says that it can be asked at once, and cannot."""

    lanes: ClassVar[bool] = True

    def adapt(self, innovation, HPHt, R, rows, memory):
        return 2.0 * R if innovation[0] > 0.0 else R


def test_one_that_cannot_be_asked_at_once_is_asked_by_each_run_and_a_sentence_says_so(rough, capsys):
    for got, pair in zip(side_by_side(rough[:2], Baseline(), Branches()), rough, strict=False):
        assert_same(got, trajectory(*pair, Baseline(), Branches()), {})

    assert "Branches is asked by each run, not by eight at once:" in capsys.readouterr().err


@dataclass(frozen=True)
class Fades(Bounded):
    """Fades as well, which nobody does at once."""

    def fade(self, innovation, HPHt, R, rows, memory):
        return 1.5


def test_one_that_fades_is_asked_by_each_run(rough):
    assert not asked_in_lanes(Fades())
    for got, pair in zip(side_by_side(rough[:2], Baseline(), Fades()), rough, strict=False):
        assert_same(got, trajectory(*pair, Baseline(), Fades()), {})


def test_a_row_of_infinite_variance_is_dropped(rough):
    rules = [Bounded(limit) for limit in (4.0, 5.0, 6.0)]

    for got, pair, rule in zip(side_by_side(rough[:3], Baseline(), rules), rough, rules, strict=False):
        assert_same(got, trajectory(*pair, Baseline(), rule), {})


@dataclass(frozen=True)
class Timid(Bounded):
    """Takes a share of the gain, and more of it with every update; drops what `Bounded` drops."""

    share: float = 0.5

    def memory_size(self):
        return 1

    def adapt_gain(self, x, P, innovation, R, rows, memory):
        memory[0] += 1.0
        K = np.zeros((len(x), len(rows)), P.dtype)
        for i in range(len(rows)):
            K[rows[i], i] = (
                self.share * memory[0] / (1.0 + memory[0]) * P[rows[i], rows[i]] / (P[rows[i], rows[i]] + R[i, i])
            )
        return K


@pytest.mark.slow
def test_a_gain_of_its_own_is_that_of_each_run(rough):
    assert asked_in_lanes(Timid())
    rules = [Timid(limit, share) for limit, share in ((1e9, 0.5), (5.0, 0.9), (4.0, 0.4))]

    for got, pair, rule in zip(side_by_side(rough[:3], Jerk(), rules), rough, rules, strict=False):
        assert_same(got, trajectory(*pair, Jerk(), rule), {})
