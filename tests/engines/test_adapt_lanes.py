"""Adaptations that many runs ask at once, against each run by itself."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from test_side_by_side import BURN_IN_S, assert_same, one, side_by_side, trajectory

from jerkbench.adaptation.chi2 import Chi2Gate, RelaxingGate
from jerkbench.adaptation.mtf import Mtf, MtfBlock, MtfNis
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.adaptation.variational_bayes import VariationalBayes, VariationalPriorAndNoise
from jerkbench.adaptation.windowed import InnovationBased
from jerkbench.compilation.lanes import above, select
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.evaluation.evaluated_run import prepare_reference
from jerkbench.filters.kinematic import Baseline, Jerk
from jerkbench.timeline import Run


@pytest.fixture(scope="module")
def rough():
    """Runs of the same steps, of which some lack velocities for a while."""
    return [one(seed) for seed in range(6)]


@pytest.mark.parametrize("cls", [VariationalBayes, pytest.param(VariationalPriorAndNoise, marks=pytest.mark.slow)])
def test_each_run_has_its_own_numbers_and_its_own_memory(rough, cls):
    rules = [cls(forgetting=value) for value in (0.999, 0.99, 0.98, 0.95, 0.9, 0.8)]

    together = side_by_side(rough, Jerk(), rules)
    backwards = side_by_side(rough[::-1], Jerk(), rules[::-1])[::-1]

    assert len({tuple(result.values()) for result in together}) == len(rules)
    for a, b, pair, rule in zip(together, backwards, rough, rules, strict=True):
        np.testing.assert_array_equal(list(a.values()), list(b.values()))
        assert_same(a, trajectory(*pair, Jerk(), rule), {})


WINDOWS, GUARDS = (1, 2, 3, 7, 30, 4), (0, 1, 0, 2, 0, 5)
GATES = ((0.9, 0), (0.5, 1), (0.2, 3), (0.2, 25), (0.99, 2))
WIDTHS = ((1.0, 0), (0.5, 1), (0.2, 3), (0.7, 25), (3.0, 2))


@pytest.mark.parametrize(
    "rules",
    [
        *([cls(window=w, guard=g) for w, g in zip(WINDOWS, GUARDS, strict=True)] for cls in (Mtf, MtfNis, MtfBlock)),
        [InnovationBased(window=window) for window in WINDOWS],
        [Chi2Gate(probability=p, longest=n) for p, n in GATES],
        [RelaxingGate(width=w, patience=n) for w, n in WIDTHS],
        [VariationalBayes(passes=passes) for passes in (1, 2, 5)],
    ],
    ids=lambda rules: type(rules[0]).__name__,
)
def test_runs_with_other_whole_numbers_are_each_its_own(rough, rules):
    pairs = rough[: len(rules)]
    for got, pair, rule in zip(side_by_side(pairs, Jerk(), rules), pairs, rules, strict=True):
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
        Run(timeline, p.scoring if consistency else p.errors_only)
        for (_, timeline), p in zip(uneven, prepared, strict=True)
    ]
    together = CompiledEngine().run_settings(runs, [Jerk()] * 11, rules, updates=False, threads=1)

    for got, run, rule in zip(together, runs, rules, strict=True):
        (alone,) = CompiledEngine().run_settings([run], [Jerk()], [rule], updates=False, threads=1)
        np.testing.assert_array_equal(got.position_m2, alone.position_m2)
        np.testing.assert_array_equal(got.nees, alone.nees)
    for got, (recording, timeline), rule in zip(together, uneven, rules, strict=True):
        wanted = trajectory(recording, timeline, Jerk(), rule)
        rmse_m = np.sqrt(got.with_burn_in_m2 / prepared[0].rows.with_burn_in.sum())
        assert rmse_m == pytest.approx(wanted["position_rmse_whole_m"], rel=1e-9)


@dataclass(frozen=True)
class Fades(NoAdaptation):
    """Fades the prior covariance more if the first innovation is larger."""

    lanes: ClassVar[bool] = True

    def fade(self, innovation, HPHt, R, rows, memory):
        return 1.0 + abs(innovation[0])


def test_a_run_is_not_faded_by_the_updates_of_other_runs(uneven):
    for got, pair in zip(side_by_side(uneven[:6], Baseline(), Fades()), uneven, strict=False):
        assert_same(got, trajectory(*pair, Baseline(), Fades()), {})


@dataclass(frozen=True)
class Bounded(NoAdaptation):
    """Finds no answer where the innovation is too large; drops what is too large for it by half."""

    limit: float = 1e9
    lanes: ClassVar[bool] = True

    def adapt(self, innovation, HPHt, R, rows, memory):
        adapted = R.copy()
        for i in range(len(rows)):
            size = abs(innovation[i])
            adapted[i, i] = select(2.0 * size, self.limit, np.inf, R[i, i]) + 0.0 * above(self.limit, size)
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

    printed = capsys.readouterr().err
    assert "Branches is called for each run separately, because it cannot be compiled" in printed
    assert "\x1b" not in printed
    assert "nopython" not in printed
