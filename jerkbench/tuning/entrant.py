"""A method as a campaign runs it: its job on a scenario, what may be tuned of it, and where its settings are run."""

import dataclasses
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError
from jerkbench.jobs.executors import Workers
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.names import job_of_parts, refusal
from jerkbench.jobs.plan import Plan, joined_jobs, sharing_scenarios
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from jerkbench.parameters import ranges_of
from jerkbench.tuning.space import Setting, Space, sampler_of, space_of

ERROR = "position_rmse"
"""The metric that is tuned for."""

LIMITS = Protocol()


@dataclass(frozen=True)
class FaultScenario:
    """A fault on a field.

    Attributes:
        noise: kind of the field's GNSS noise.
        dataset: the field with its parameters.
        family: of the fault.
        severity: of the fault.
        disturbance: with its parameters.
    """

    noise: str
    dataset: dict[str, Any]
    family: str
    severity: str
    disturbance: dict[str, Any]

    @property
    def fault(self) -> str:
        """The fault's name."""
        return self.family if self.severity == self.family else f"{self.family} {self.severity}"

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"{self.noise}, {self.fault}"


@dataclass(frozen=True)
class Entrant:
    """A filter with an adaptation, as it was given.

    Attributes:
        filter: {"name": ..., parameters}.
        adaptation: likewise.
        r_scale: what it is told of the reported R.
    """

    filter: Mapping[str, Any]
    adaptation: Mapping[str, Any]
    r_scale: Mapping[str, float]

    @classmethod
    def named(cls, filter: str, adaptation: str) -> "Entrant":  # noqa: A002 - as the group is called
        """Return plugins at their defaults."""
        return cls({"name": filter}, {"name": adaptation}, {})

    @property
    def name(self) -> str:
        """Its filter and its adaptation."""
        return f"{self.filter['name']} + {self.adaptation['name']}"

    @cached_property
    def text(self) -> str:
        """All of it, the same for the same method."""
        return json.dumps(self.parts, sort_keys=True)

    @property
    def parts(self) -> dict[str, Any]:
        """What it was given, as plain data."""
        return dataclasses.asdict(self)

    def job(self, scenario: FaultScenario, limits: Protocol = LIMITS, metrics: Sequence[str] = (ERROR,)) -> Job:
        """Return its job on a scenario, with the attitude filter of the data set.

        Raises:
            PluginError: it cannot be made, or its parts do not fit together.
        """
        single = {
            "dataset": scenario.dataset,
            "attitude": None,
            "filter": self.filter,
            "adaptation": self.adaptation,
            "engine": "compiled",
        }
        job = job_of_parts(single, [scenario.disturbance], None, limits, metrics, self.r_scale or None)
        if reason := refusal(job):
            raise PluginError(f"This method cannot enter: {reason}.")
        return dataclasses.replace(job, labels=job.labels._replace(dataset=scenario.noise, disturbance=scenario.fault))


def knobs_of(job: Job) -> Space:
    """Return what may be tuned of a method; nothing where no part has a parameter with a range, as of a program."""
    scenario, method = job.scenario, job.method
    parts = (scenario.attitude,) if is_attitude_only(method.filter) else (method.filter, method.adaptation)
    return space_of(job) if any(ranges_of(type(part)) for part in parts) else Space(())


def tried_settings(trials: int, space: Space, restart: int = 0) -> tuple[Setting, ...]:
    """Return the settings that one search tries: the one before it, then points of a Sobol sequence.

    Two methods with as many knobs try the same shares of their ranges; another ``restart`` is another scramble.
    """
    if not space.knobs or trials < 2:
        return (space.start,)
    return (space.start, *map(space.setting, _shares(len(space.knobs), restart, trials - 1)))


_shares: Callable[[int, int, int], FloatArray] = lru_cache(256)(lambda k, r, n: sampler_of("sobol", k, r).ask(n))
"""The first ``n`` points for ``k`` knobs and restart ``r``: to scramble a sequence takes as long as several runs."""


# Where settings are run over scenarios: what is stored is not run again.

NUMBERS = ("position_rmse_m", "anees")
"""What is kept of a run that navigates."""

TOGETHER = 20_000
"""So many settings are planned at once: their jobs are in memory."""


class Try(NamedTuple):
    """A setting of a method that is run over a scenario.

    Attributes:
        number: of the scenario.
        scenario: the scenario.
        entrant: the method.
        setting: of its knobs.
        trial: what its rows are found by.
        seeds: of its runs.
    """

    number: int
    scenario: FaultScenario
    entrant: Entrant
    setting: Setting
    trial: int
    seeds: Sequence[int]


@dataclass(frozen=True)
class RunRules:
    """How the runs of a campaign are made and judged.

    Attributes:
        metrics: what is computed.
        limits: how each run is judged.
        numbers: columns that are kept of a run.
    """

    metrics: tuple[str, ...]
    limits: Protocol = LIMITS
    numbers: tuple[str, ...] = NUMBERS


MANY_PARTS = 16
"""Small files of rows that are joined into one: a campaign writes many, and joins them now and then."""


@dataclass(frozen=True)
class Site:
    """Where settings are run and stored.

    Attributes:
        folder: of what is stored.
        workers: who runs them; None: this process.
    """

    folder: Path
    workers: Workers | None = None

    def rows(self, tries: Iterable[Try], rules: RunRules, bar: Progress) -> pd.DataFrame:
        """Run the settings that are not stored yet, and return the rows of all, in their order.

        Args:
            tries: those of one scenario together, and there those of one method.
            rules: how they are run.
            bar: is told of every setting that is done.

        Returns:
            scenario, filter, adaptation, trial, seed, status, reason, the numbers of the rules, seconds.

        Raises:
            JerkbenchError: nothing can be stored, or the cluster cannot go on.
        """
        every = list(tries)
        parts = [self._rows(every[k : k + TOGETHER], rules, bar) for k in range(0, len(every), TOGETHER)]
        return pd.concat(parts, ignore_index=True)

    def _rows(self, tries: Sequence[Try], rules: RunRules, bar: Progress) -> pd.DataFrame:
        jobs = _jobs(tries, rules)
        rows = self.rows_of(jobs, rules.numbers, progress=bar)
        bar.advance(count=len(jobs) - len({job.key for job in jobs}))  # settings that are the same run once
        heads = [(own.number, own.entrant.filter["name"], own.entrant.adaptation["name"], own.trial) for own in tries]
        head = pd.DataFrame(heads, columns=["scenario", "filter", "adaptation", "trial"])
        named = head.iloc[rows["place"].to_numpy()].reset_index(drop=True)
        found = rows[["seed", "status", "reason", *rules.numbers]].astype(dict.fromkeys(rules.numbers, float))
        return named.join(found).assign(seconds=rows["run_s"])

    def rows_of(self, jobs: Sequence[Job], numbers: Sequence[str], **how: Any) -> pd.DataFrame:  # noqa: ANN401 - of `run_missing`
        """Run what is missing of some jobs, and return what `Store.rows` has of all of them.

        Args:
            jobs: with the seeds that are wanted.
            numbers: the metrics that are wanted.
            how: further arguments of `run_missing`.

        Raises:
            JerkbenchError: nothing can be stored, or the cluster cannot go on.
        """
        store = Store(self.folder)
        run_missing(Plan(joined_jobs(jobs)), store, self.workers, **how)
        store.compact(MANY_PARTS)
        return store.rows(jobs, numbers)


def _jobs(tries: Sequence[Try], rules: RunRules) -> list[Job]:
    jobs: list[Job] = []
    made: dict[tuple[int, str], tuple[Job, Space]] = {}
    for each in tries:
        if (which := (id(each.scenario), each.entrant.text)) not in made:
            job = each.entrant.job(each.scenario, rules.limits, rules.metrics)
            made[which] = job, knobs_of(job)
        job, space = made[which]
        jobs.append(dataclasses.replace(space.applied(job, each.setting), draws=each.seeds))
    return sharing_scenarios(jobs)
