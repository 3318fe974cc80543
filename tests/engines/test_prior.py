"""Adaptations that change the prior covariance, or have a gain of their own: both engines against a plain filter."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from test_compiled_engine import Damped
from test_side_by_side import assert_same, one, side_by_side, trajectory

from engine_agreement import agree
from jerkbench import plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.filters.kinematic import Jerk
from plain_filter import assert_follows, run_plain, update
from rough import rough_timeline


@dataclass(frozen=True)
class Weighed(NoAdaptation):
    """Uses all that there is to see, remembers as many numbers as there are states, and drops a row now and then."""

    share: float = 0.5

    def memory_size_of(self, states):
        return states + 1

    def adapt_prior(self, x, P, F, Q, innovation, R, rows, memory):
        memory[:-1] = 0.5 * memory[:-1] + np.abs(x)
        memory[-1] += np.abs(innovation).max() / np.sqrt(np.trace(R))
        weight = 1.0 + self.share * memory[:-1] / (1.0 + memory[:-1])
        return (P - Q) * np.outer(weight, weight) + 2.0 * Q + 1e-6 * F @ F.T

    def adapt(self, innovation, HPHt, R, rows, memory):
        adapted = 1.1 * R + 0.1 * HPHt
        if memory[-1] > 20.0:
            memory[-1] = 0.0
            adapted[0, 0] = np.inf
        return adapted


@dataclass(frozen=True)
class Timid(Weighed):
    """Takes a share of the gain."""

    def adapt_gain(self, x, P, innovation, R, rows, memory):
        return 0.9 * np.linalg.solve(P[rows][:, rows] + R, P[rows]).T + 1e-3 * np.outer(x, innovation)


def plain_correction(rule, states):
    """What the contract promises of ``rule``, with the formulas of Joseph's form written out."""
    memory = np.zeros(rule.memory_size_of(states))

    def correct(prior, z, H, R, rows):
        np.testing.assert_allclose(prior.F @ prior.before @ prior.F.T + prior.Q, prior.P, rtol=1e-9, atol=1e-15)
        y = z - H @ prior.x
        P = rule.adapt_prior(prior.x, prior.P, prior.F, prior.Q, y, R, rows, memory)
        R = rule.adapt(y, H @ P @ H.T, R, rows, memory)
        kept = np.isfinite(np.diag(R))
        if not kept.any():
            return prior.x, P
        y, H, R = y[kept], H[kept], R[np.ix_(kept, kept)]
        if not hasattr(rule, "adapt_gain"):
            return update(prior.x, P, z[kept], H, R)
        K = rule.adapt_gain(prior.x, P, y, R, rows[kept], memory)
        rest = np.eye(len(P)) - K @ H
        return prior.x + K @ y, rest @ P @ rest.T + K @ R @ K.T

    return correct


@pytest.fixture(scope="module")
def timeline():
    return rough_timeline(4.0)


@pytest.mark.slow
@pytest.mark.parametrize("rule", [Weighed(), Timid()], ids=["prior", "gain"])
@pytest.mark.parametrize("engine", [FilterpyEngine(), CompiledEngine()], ids=["filterpy", "compiled"])
def test_an_engine_does_what_the_contract_promises(timeline, engine, rule):
    estimate = engine.run(timeline, Jerk(), rule)

    assert_follows(estimate, run_plain(timeline, Jerk(), plain_correction(rule, 9)))
    assert np.isinf(estimate.updates.R_diagonal).any()


@pytest.mark.slow
@pytest.mark.parametrize("rule", [Weighed(), Timid()], ids=["prior", "gain"])
def test_both_engines_agree_over_a_model_of_another_size(timeline, rule):
    agree(timeline, Damped(), rule)


@pytest.mark.slow
def test_side_by_side_each_run_has_its_own_prior_and_gain():
    """Also a run with a transition of its own, beside runs without any; their neighbours lack rows and updates."""
    pairs = [one(0), one(1), one(2, velocity=None), one(3)]
    pairs[3] = with_fewer_updates(*pairs[3])
    models, rules = [Jerk(), Jerk(0.3), Jerk(), Jerk()], [Weighed(), NoAdaptation(), Timid(), Weighed(0.2)]

    for got, pair, model, rule in zip(side_by_side(pairs, models, rules), pairs, models, rules, strict=True):
        assert_same(got, trajectory(*pair, model, rule), {})


def with_fewer_updates(recording, timeline):
    fewer = timeline.update.copy()
    fewer[np.flatnonzero(fewer >= 0)[5:40:3]] = -1
    return recording, replace(timeline, update=fewer)


@dataclass(frozen=True)
class Indefinite(NoAdaptation):
    def adapt_prior(self, x, P, F, Q, innovation, R, rows, memory):
        return -P if np.abs(innovation).max() > 0.6 else P.copy()


def test_a_prior_that_is_no_covariance_ends_the_run_in_both_engines(timeline):
    runs = [engine.run(timeline, Jerk(), Indefinite()) for engine in (FilterpyEngine(), CompiledEngine())]

    assert runs[0].failure == runs[1].failure != ""


def test_no_estimator_takes_what_changes_more_than_r():
    names = plugins.names("adaptation")
    beyond = {
        name for name in names if {"fade", "adapt_prior", "adapt_gain"} & set(dir(plugins.get("adaptation", name)))
    }

    assert beyond >= {"scalar_q", "adaptive_q"}
    assert set(plugins.create("filter", {"name": "eskf15"}).adaptations) == set(names) - beyond
