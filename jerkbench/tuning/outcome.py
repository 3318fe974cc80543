"""A tuning from its cases to its score: the search, its restarts, and runs that none of them has seen."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.tuning.evaluate import Evaluator, RunPlace, require_scorable
from jerkbench.tuning.objectives import Objective
from jerkbench.tuning.search import Budget, SearchOutcome, TuningScore, score, search
from jerkbench.tuning.space import Setting, Space
from jerkbench.tuning.splits import Cases


@dataclass(frozen=True)
class Effort:
    """What a tuning does, besides its cases.

    Attributes:
        objective: what a setting is worth.
        budget: of each search.
        restarts: searches; the first one's setting is taken, the others show how much is luck.
        knobs: names of those to change; empty: all.
        threads: how many the engine may use in each process.
    """

    objective: Objective
    budget: Budget
    restarts: int = 1
    knobs: tuple[str, ...] = ()
    threads: int = 1


@dataclass(frozen=True, eq=False)
class Restart:
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
    name: str, cases: Cases, space: Space, effort: Effort, runs: RunPlace, advance: Callable[[int], object] = int
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
