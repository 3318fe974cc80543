"""The compiled engine against the reference engine, over whole runs.

Warm, that is with the compiled code of an earlier session on the disk, nearly all of the time is the reference
engine's. Cold, three loops are compiled (for 6, 9 and 12 states) and each adaptation.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest

from engine_agreement import agree
from jerkbench import plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.filters.kinematic import Baseline, Jerk
from rough import rough_timeline

FILTERS = [name for name in plugins.names("filter") if hasattr(plugins.get("filter", name), "axis_model")]
ADAPTATIONS = plugins.names("adaptation")
LONG = (("jerk", "mtf"), ("acceleration", "scalar_q"))


@pytest.fixture(scope="module")
def timeline():
    return rough_timeline(5.0)


@pytest.fixture(scope="module")
def long_timeline():
    return rough_timeline(60.0)


def slow_where_dense(pairs):
    """Rules that see whole matrices have loops of their own, and take seconds each to compile."""
    dense = {n for n in ADAPTATIONS if {"adapt_prior", "adapt_gain"} & set(dir(plugins.get("adaptation", n)))}
    return [pytest.param(*pair, marks=pytest.mark.slow if pair[1] in dense else ()) for pair in pairs]


@pytest.mark.parametrize(("model", "adaptation"), slow_where_dense(product(FILTERS, ADAPTATIONS)))
def test_every_filter_with_every_adaptation_agrees_with_the_reference_engine(short_timeline, model, adaptation, capsys):
    pair = plugins.create("filter", {"name": model}), plugins.create("adaptation", {"name": adaptation})
    agree(short_timeline, *pair)
    assert "runs on the engine filterpy" not in capsys.readouterr().err


@pytest.mark.parametrize(("model", "adaptation"), LONG)
def test_a_minute_agrees_too(long_timeline, model, adaptation):
    agree(long_timeline, plugins.create("filter", {"name": model}), plugins.create("adaptation", {"name": adaptation}))


@pytest.mark.parametrize("model", FILTERS)
def test_a_run_starts_from_a_covariance_with_correlations(timeline, model):
    """Position with velocity on one axis, and all axes with each other."""
    half = np.random.default_rng(3).normal(size=(6, 8)) * np.sqrt(np.diag(timeline.P0))[:, None]
    agree(replace(timeline, P0=half @ half.T), plugins.create("filter", {"name": model}), NoAdaptation())


@pytest.mark.parametrize(("model", "adaptation"), [("jerk", "none"), ("jerk", "mtf"), ("acceleration", "huber_r")])
def test_rounding_is_not_amplified_where_nothing_is_steep(timeline, model, adaptation):
    pair = plugins.create("filter", {"name": model}), plugins.create("adaptation", {"name": adaptation})
    assert agree(timeline, *pair) == (None, False)


@dataclass(frozen=True)
class Threshold(NoAdaptation):
    """Takes one decision in a run, at update ``at``: whether R grows."""

    at: int = 0
    threshold: float = np.inf

    def memory_size(self):
        return 1

    def adapt(self, innovation, HPHt, R, rows, memory):
        memory[0] += 1.0
        nis = np.sum(innovation * np.linalg.solve(HPHt + R, innovation))
        return 4.0 * R if int(memory[0]) - 1 == self.at and nis > self.threshold else R


@pytest.fixture(scope="module")
def short_timeline():
    return rough_timeline(2.5)


def test_a_threshold_that_is_a_little_wrong_is_no_rounding(short_timeline):
    nis = FilterpyEngine().run(short_timeline, Jerk(), Threshold()).updates.nis
    right, wrong = (Threshold(7, nis[7] * (1.0 + error)) for error in (5e-10, -5e-10))

    with pytest.raises(AssertionError, match="update 7"):
        agree(short_timeline, Jerk(), right, CompiledEngine().run(short_timeline, Jerk(), wrong))


@pytest.mark.parametrize("adaptation", ["none", "scalar_q", "cerkf_r"])
def test_an_engine_that_is_a_little_wrong_does_not_agree(timeline, adaptation):
    pair = plugins.create("filter", {"name": "acceleration"}), plugins.create("adaptation", {"name": adaptation})
    given = timeline.measurements
    wrong = replace(timeline, measurements=replace(given, R=given.R * (1.0 + 1e-10)))

    with pytest.raises(AssertionError):
        agree(timeline, *pair, CompiledEngine().run(wrong, *pair))


@dataclass(frozen=True)
class Faded(NoAdaptation):
    """Parameters of all kinds, a fade, memory, dropped rows and a helper."""

    factor: float = 1.5
    every: int = 3
    on: bool = True
    weights: tuple[float, ...] = (1.0, 2.0, 3.0)

    def memory_size(self):
        return 1

    def fade(self, innovation, HPHt, R, rows, memory):
        memory[0] += 1.0
        return self.factor if self.on and int(memory[0]) % self.every == 0 else 1.0

    def adapt(self, innovation, HPHt, R, rows, memory):
        adapted = weighted(R, self.weights[int(memory[0]) % 3]) + 0.1 * HPHt  # the faded one
        if int(memory[0]) % 5 == 0:
            adapted[0, :] = np.inf
            adapted[:, 0] = np.inf
        if int(memory[0]) % 7 == 0:
            for i in range(len(rows)):
                adapted[i, i] = np.inf
        return adapted.T  # not contiguous


def weighted(R, weight):
    return weight * R


def test_fading_dropped_rows_helpers_and_parameters_of_all_kinds(timeline):
    for adaptation in (Faded(), Faded(factor=1.1, every=2, weights=(3.0, 1.0, 1.0)), Faded(on=False)):
        run = CompiledEngine().run(timeline, Jerk(), adaptation)
        agree(timeline, Jerk(), adaptation, run)
        assert np.isnan(run.updates.nis_used).any()
        assert np.isinf(run.updates.R_diagonal).any()


@dataclass(frozen=True)
class Damped:
    """Four states on an axis; A is not triangular with ones on its diagonal."""

    def axis_model(self, dt, dt0):
        A = np.eye(4) + dt * np.diag([1.0, 1.0, 1.0], 1)
        A[2, 2], A[3, 1] = np.exp(-dt / 5.0), -0.1 * dt
        return A, np.array([0.5 * dt**2, dt, 0.0, 0.0]), 0.01 * dt * np.diag([0.0, 1.0, 1.0, 2.0])

    def initial_variances(self):
        return np.array([1.0, 0.5])


@pytest.mark.slow
def test_any_model_of_any_size(timeline):
    pair = Damped(), plugins.create("adaptation", {"name": "scalar_r"})
    agree(timeline, *pair)


@dataclass(frozen=True)
class Dictionary(NoAdaptation):
    def adapt(self, innovation, HPHt, R, rows, memory):
        return dict.fromkeys(("R", "Q"), 2.0 * R).popitem()[1]


@dataclass(frozen=True)
class Formatted(NoAdaptation):
    def adapt(self, innovation, HPHt, R, rows, memory):
        return R * len(f"{R[0, 0]:.3f}")


@pytest.mark.parametrize("adaptation", [Dictionary(), Formatted()], ids=["types", "bytecode"])
def test_what_numba_cannot_compile_runs_on_the_reference_engine_with_one_line(timeline, capsys, adaptation):
    engine, models = CompiledEngine(), (Baseline(), Jerk())
    runs = [engine.run(timeline, model, adaptation) for model in models]
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "Compiling" not in line]

    for model, run in zip(models, runs, strict=True):
        agree(timeline, model, adaptation, run)
    start = f"jerkbench: {type(adaptation).__name__} runs on the engine filterpy: "
    assert line.startswith(start)
    assert len(line) > len(start) + 10
