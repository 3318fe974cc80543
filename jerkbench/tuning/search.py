"""The search: settings tried, one chosen, and scored on runs that no search has seen; a tuning is one or several."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.tuning.entrant import Site
from jerkbench.tuning.evaluate import Evaluator, Objective, Trials, joined_trials, require_scorable
from jerkbench.tuning.space import Setting, Space, sampler_of
from jerkbench.tuning.splits import Cases

SETTINGS_AT_ONCE = 16
"""Settings that are tried together: what a learning sampler learns from next."""


@dataclass(frozen=True)
class Budget:
    """What a search may spend, the same for every method of a comparison.

    Attributes:
        trials: settings that are tried on the cases to tune on, the one from before the search among them.
        sampler: which settings: sobol, tpe or cma_es.
        finalists: how many of the best are tried again on the cases to choose on.
        seed: of the sampler; another one is another scramble.
    """

    trials: int = 64
    sampler: str = "sobol"
    finalists: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.trials < 1 or self.finalists < 1 or self.seed < 0:
            raise PluginError(
                f"trials is {self.trials}, finalists {self.finalists} and sampler_seed {self.seed}; at least one trial"
                " and one finalist are needed, and a seed is not negative."
            )


class SearchOutcome(NamedTuple):
    """The outcome of a search.

    Attributes:
        setting: the chosen one.
        place: which of the trials it is.
        trials: all of them, on the cases to tune on.
        finalists: the best of them again, on the cases to choose on; None without such cases.
    """

    setting: Setting
    place: int
    trials: Trials
    finalists: Trials | None


class TuningScore(NamedTuple):
    """Losses on runs that the search has not seen, mean over the draws of each case.

    Attributes:
        before: (cases,) of the setting before the search.
        chosen: (cases,) of the chosen one.
        lost_before: lost runs of the first.
        lost: lost runs of the second.
        runs: of either.
        errors: (n,) the geometric mean over the cases of the errors of the chosen setting, for each seed that all cases
            share; infinite where a run was lost, empty where the cases share no seed or the objective is no error.
    """

    before: FloatArray
    chosen: FloatArray
    lost_before: int
    lost: int
    runs: int
    errors: FloatArray


def search(evaluator: Evaluator, cases: Cases, budget: Budget, advance: Callable[[int], object] = int) -> SearchOutcome:
    """Try ``budget.trials`` settings and choose one.

    Args:
        evaluator: of the method's space.
        cases: of which those to test on are not looked at.
        budget: what may be spent.
        advance: is told how many settings more are done.

    Raises:
        JerkbenchError: the sampler is unknown, or a run failed.
    """
    trials = _tried(evaluator, cases.tune, budget, advance)
    best, finalists = trials.best(budget.finalists if cases.choose else 1), None
    if cases.choose:
        finalists = evaluator.trials([trials.settings[place] for place in best], cases.choose)
    place = best[finalists.best(1)[0] if finalists else 0]
    return SearchOutcome(trials.settings[place], place, trials, finalists)


def score(evaluator: Evaluator, setting: Setting, cases: Sequence[Job]) -> TuningScore:
    """Return what the setting before the search and ``setting`` are worth on cases that the search has not seen."""
    both = evaluator.trials([evaluator.space.start, setting], cases)
    lost_before, lost = (int(count) for count in both.lost.sum(axis=1))
    shared = all(case.scenario.seeded and case.draws == cases[0].draws for case in cases)
    errors = np.empty(0)
    if shared and evaluator.objective.relative:
        errors = np.exp(np.log(both.values[1]).reshape(len(cases), -1).mean(axis=0))
        errors[np.isnan(errors)] = np.inf
    return TuningScore(both.losses[0], both.losses[1], lost_before, lost, both.lost.shape[1], errors)


def equal_budgets(outcomes: dict[str, SearchOutcome]) -> str:
    """Say how many settings each method was given.

    Raises:
        JerkbenchError: they are not the same for all methods: such results are not to be compared.
    """
    counts = {name: len(outcome.trials) for name, outcome in outcomes.items()}
    if len(set(counts.values())) > 1:
        each = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise JerkbenchError(f"The methods were not tuned alike: settings tried: {each}; give all the same trials=.")
    (count,) = set(counts.values())
    several = f"Equal budgets: each of {len(counts)} methods tried {count} settings."
    return several if len(counts) > 1 else f"Budget: {count} settings tried."


def _tried(evaluator: Evaluator, cases: Sequence[Job], budget: Budget, advance: Callable[[int], object]) -> Trials:
    """Try the setting before the search, and then those of the sampler, block by block."""
    space = evaluator.space
    sampler = sampler_of(budget.sampler, len(space.knobs), budget.seed)
    parts: list[Trials] = []
    for done in range(0, budget.trials, SETTINGS_AT_ONCE):
        first = [] if done else [space.start]
        count = min(SETTINGS_AT_ONCE, budget.trials - done) - len(first)
        parts.append(evaluator.trials([*first, *map(space.setting, sampler.ask(count) if count else ())], cases))
        if count:
            sampler.tell(parts[-1].means[len(first) :].tolist())
        advance(len(parts[-1]))
    return joined_trials(parts)


# A tuning from its cases to its score.


@dataclass(frozen=True)
class Effort:
    """What a tuning does, besides its cases.

    Attributes:
        objective: what a setting is worth.
        budget: of each search.
        restarts: searches; the first one's setting is taken, the others show how much is luck.
        threads: how many the engine may use in each process.
    """

    objective: Objective
    budget: Budget
    restarts: int = 1
    threads: int = 1


class Restart(NamedTuple):
    """One search of a tuning.

    Attributes:
        setting: the chosen one.
        score: on the cases to test on.
    """

    setting: Setting
    score: TuningScore


@dataclass(frozen=True, eq=False)
class Tuning:
    """A tuned method.

    Attributes:
        name: of the method, fit for a file.
        space: its knobs.
        cases: what it was tuned, chosen and tested on.
        effort: how.
        outcome: that of the first search.
        restarts: all searches, the first one first.
        interval_s: nominal interval of the IMU; None: there is none.
    """

    name: str
    space: Space
    cases: Cases
    effort: Effort
    outcome: SearchOutcome
    restarts: tuple[Restart, ...]
    interval_s: float | None

    @property
    def job(self) -> Job:
        """The first scenario with the method before the search."""
        return self.cases.tune[0]

    @property
    def setting(self) -> Setting:
        """The chosen setting: that of the first search, so that all methods spend the same."""
        return self.outcome.setting

    @property
    def score(self) -> TuningScore:
        """Its score on the cases to test on."""
        return self.restarts[0].score


def tune(
    name: str, cases: Cases, space: Space, effort: Effort, runs: Site, advance: Callable[[int], object] = int
) -> Tuning:
    """Tune one method; what is stored is not run again.

    Args:
        name: of the method.
        cases: to tune, to choose and to test on.
        space: the knobs.
        effort: how.
        runs: where they are done and stored, those of other methods, too.
        advance: is told how many settings more are done.

    Raises:
        JerkbenchError: a recording lacks what the objective asks for, or a run failed.
    """
    evaluator = Evaluator(space, effort.objective, effort.threads, runs)
    first = cases.tune[0]
    recording = shared_inputs().recording(first.scenario, first.draws[0])
    require_scorable(effort.objective, first, recording)
    budgets = [replace(effort.budget, seed=effort.budget.seed + k) for k in range(effort.restarts)]
    outcomes = [search(evaluator, cases, budget, advance) for budget in budgets]
    restarts = tuple(Restart(outcome.setting, score(evaluator, outcome.setting, cases.test)) for outcome in outcomes)
    interval_s = recording.imu.nominal_interval_s if recording.imu is not None else None
    return Tuning(name, space, cases, effort, outcomes[0], restarts, interval_s)
