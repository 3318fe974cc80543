"""A method as a campaign runs it: its parts, its cell on a scenario, and what may be tuned of it."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jerkbench.campaigns.protocol import FaultScenario
from jerkbench.errors import PluginError
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.names import job_of_parts, refusal
from jerkbench.optional import is_attitude_only
from jerkbench.parameters import ranges_of
from jerkbench.tuning.samplers import sampler_of
from jerkbench.tuning.space import Setting, Space, space_of

ERROR = "position_rmse"
"""The metric that is tuned for."""

LIMITS = Protocol()


@dataclass(frozen=True)
class Entrant:
    """A filter with an adaptation, or an attitude filter, as it was given.

    Attributes:
        filter: {"name": ..., parameters}.
        adaptation: likewise.
        r_scale: what it is told of the reported R.
        attitude: the attitude filter, where it is the method; None: that of the data set.
    """

    filter: Mapping[str, Any]
    adaptation: Mapping[str, Any]
    r_scale: Mapping[str, float]
    attitude: Mapping[str, Any] | None = None

    @classmethod
    def named(cls, filter: str, adaptation: str, attitude: str = "") -> "Entrant":  # noqa: A002 - as the group is called
        """Return plugins at their defaults."""
        return cls({"name": filter}, {"name": adaptation}, {}, {"name": attitude} if attitude else None)

    @property
    def name(self) -> str:
        """Its filter and its adaptation, or its attitude filter."""
        if self.attitude:
            return str(self.attitude["name"])
        return f"{self.filter['name']} + {self.adaptation['name']}"

    @property
    def text(self) -> str:
        """All of it, the same for the same method."""
        return json.dumps(self.parts, sort_keys=True)

    @property
    def parts(self) -> dict[str, Any]:
        """What it was given, as plain data."""
        return {name: value for name, value in dataclasses.asdict(self).items() if value is not None}

    def job(
        self,
        scenario: FaultScenario,
        limits: Protocol = LIMITS,
        metrics: Sequence[str] = (ERROR,),
    ) -> Job:
        """Return its job on a scenario; an attitude filter that it has not is that of the data set.

        Raises:
            PluginError: it cannot be made, or its parts do not fit together.
        """
        single = {
            "dataset": scenario.dataset,
            "attitude": self.attitude,
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
    tunable = any(ranges_of(type(part)) for part in parts)
    return space_of(job) if tunable else Space(())


def tried_settings(trials: int, space: Space, restart: int = 0) -> tuple[Setting, ...]:
    """Return the settings that one search tries: the one before it, then points of a Sobol sequence.

    Two methods with as many knobs try the same shares of their ranges; another ``restart`` is another scramble.
    """
    if not space.knobs or trials < 2:
        return (space.start,)
    shares = sampler_of("sobol", len(space.knobs), restart).ask(trials - 1)
    return (space.start, *map(space.setting, shares))
