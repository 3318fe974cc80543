"""The cases of a tuning: what a setting is tuned on, and what it is scored on, which the search never sees."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from jerkbench.errors import PluginError, RecordingError
from jerkbench.jobs.job import MOST_SEEDS, Job
from jerkbench.recording import Recording
from jerkbench.renamed import new_name

LEAST = 2
"""Rows of a stream without which nothing can be estimated."""


@dataclass(frozen=True)
class Excerpt:
    """The part of a recording before or after a time.

    Attributes:
        share: of the duration, at which the two parts meet [-].
        late: whether errors count from there on, over the whole recording; else the recording ends there.
    """

    seeded: ClassVar[bool] = False

    share: float
    late: bool

    def apply(self, recording: Recording, seed: int) -> Recording:  # noqa: ARG002 - the contract of a disturbance
        """Return the part.

        Raises:
            RecordingError: too little of it is left.
        """
        at_s = self.share * recording.duration_s
        return scored_from(recording, at_s) if self.late else ended_at(recording, at_s)

    def replicates(self) -> int:
        """Return 1."""
        return 1


def scored_from(recording: Recording, begin_s: float) -> Recording:
    """Return the recording with errors that count from ``begin_s`` on."""
    reference = recording.reference
    return replace(recording, reference=replace(reference, scored=reference.scored & (reference.t_s >= begin_s)))


def ended_at(recording: Recording, end_s: float) -> Recording:
    """Return the recording without anything after ``end_s``.

    Raises:
        RecordingError: a stream has fewer than two rows left.
    """
    streams: dict[str, Any] = {}
    for name in ("imu", "position", "velocity", "heading", "reference"):
        stream = getattr(recording, name)
        if stream is not None:
            streams[name] = _first_rows(stream, int(np.searchsorted(stream.t_s, end_s, side="right")), recording.name)
    outages_s = recording.outages_s[recording.outages_s[:, 0] < end_s]
    return replace(recording, **streams, outages_s=np.minimum(outages_s, end_s))


def _first_rows(stream: Any, count: int, name: str) -> Any:  # noqa: ANN401 - any stream, by its fields
    if count < LEAST:
        raise RecordingError(
            f"{name} has {count} rows of {type(stream).__name__} before the end of the part to tune on; take a larger"
            " share of the time."
        )
    rows = len(stream.t_s)
    whole = {key: value for key, value in vars(stream).items() if isinstance(value, np.ndarray)}
    return replace(stream, **{key: value[:count] for key, value in whole.items() if len(value) == rows})


@dataclass(frozen=True, eq=False)
class Cases:
    """The cases of a tuning.

    Attributes:
        tune: on which every setting is tried.
        choose: on which the best of them are tried again, and one is chosen; empty: the best on ``tune`` is.
        test: on which the chosen one is scored.
        split: how they were told apart, one phrase.
    """

    tune: tuple[Job, ...]
    choose: tuple[Job, ...]
    test: tuple[Job, ...]
    split: str


def require_cases(jobs: Sequence[Job]) -> None:
    """Check that the jobs are of one method.

    Raises:
        PluginError: there is none, or they differ in filter, adaptation, noise or engine.
    """
    if not jobs:
        raise PluginError("There is no scenario to tune on; give dataset=... and disturbance=...")
    first = jobs[0].method
    for job in jobs:
        for name in ("filter", "adaptation", "r_scale", "engine"):
            if getattr(job.method, name) != getattr(first, name):
                raise PluginError(f"A tuning is of one method, but its scenarios have different values of {name}.")


@dataclass(frozen=True)
class Seeds:
    """Numbers of seeds; they follow each other from ``first`` on, so that no two parts share one.

    Attributes:
        tune: to try every setting on.
        choose: to choose among the best; 0: none.
        test: to score on.
        first: the first of them.
    """

    tune: int = 16
    choose: int = 16
    test: int = 40
    first: int = 0

    def __post_init__(self) -> None:
        """Check that there is something to tune on, and something to score on."""
        if self.tune < 1 or self.test < 1 or self.choose < 0 or self.first < 0:
            raise PluginError(
                f"tune_seeds is {self.tune}, choose_seeds {self.choose}, test_seeds {self.test} and first_seed"
                f" {self.first}; at least one seed to tune and one to test are needed, and none is negative."
            )

        if max(self.tune, self.choose, self.test) > MOST_SEEDS:
            raise PluginError(
                f"tune_seeds is {self.tune}, choose_seeds {self.choose} and test_seeds {self.test}; give at most"
                f" {MOST_SEEDS} of each."
            )

    @property
    def parts(self) -> tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]:
        """The seeds to tune, to choose and to test on."""
        begin, middle = self.first + self.tune, self.first + self.tune + self.choose
        return tuple(range(self.first, begin)), tuple(range(begin, middle)), tuple(range(middle, middle + self.test))


def by_seeds(jobs: Sequence[Job], seeds: Seeds) -> Cases:
    """Return the same scenarios with other seeds.

    Raises:
        PluginError: a scenario has nothing random.
    """
    require_cases(jobs)
    for job in jobs:
        if not job.scenario.seeded:
            raise PluginError(
                f"Nothing in {job.labels.dataset} with {job.labels.disturbance} is random, so other seeds would be"
                " the same run: use split=time, or split=recordings."
            )
    tune, choose, test = seeds.parts
    words = f"seeds {_span(tune)} to tune, {_span(choose) or 'none'} to choose, {_span(test)} to test"
    return Cases(_cases(jobs, tune), _cases(jobs, choose) if choose else (), _cases(jobs, test), words)


def by_time(jobs: Sequence[Job], seeds: Seeds, share: float = 0.5) -> Cases:
    """Return the first part of each recording to tune on, and the rest to test on.

    While tuning the recording ends at ``share`` of its duration: nothing later is in it. The test runs over all of it,
    and errors count from there on.
    """
    require_cases(jobs)
    if not 0 < share < 1:
        raise PluginError(f"The share of the time to tune on is {share:g}; it must lie between 0 and 1.")
    tune, test = (
        _cases([_cut(job, Excerpt(share, late=late)) for job in jobs], seeds.parts[0]) for late in (False, True)
    )
    return Cases(tune, (), test, f"the first {100 * share:g} % of the time to tune, the rest to test")


def by_group(jobs: Sequence[Job], held_out: Sequence[bool], seeds: Seeds, words: str) -> Cases:
    """Return some scenarios to tune on, and others, of which the search sees nothing, to test on.

    Args:
        jobs: the scenarios.
        held_out: (len(jobs),) whether each is to test on.
        seeds: of those with anything random, disjoint as well.
        words: how they were told apart.

    Raises:
        PluginError: one of the two is empty.
    """
    require_cases(jobs)
    seen = [job for job, held in zip(jobs, held_out, strict=True) if not held]
    unseen = [job for job, held in zip(jobs, held_out, strict=True) if held]
    if not seen or not unseen:
        raise PluginError(f"A split by {words} needs scenarios on both sides; there are {len(seen)} and {len(unseen)}.")
    tune, choose, test = seeds.parts
    chosen = _cases(seen, choose) if choose and all(job.scenario.seeded for job in seen) else ()
    return Cases(_cases(seen, tune), chosen, _cases(unseen, test), words)


def by_families(jobs: Sequence[Job], held_out: Sequence[str], seeds: Seeds) -> Cases:
    """Return the scenarios whose disturbance is none of ``held_out`` to tune on, and those of ``held_out`` to test on.

    Where nothing is wrong (`none`) a setting has to be good as well: it is on both sides.
    """
    held_out = [new_name("disturbance", name) for name in held_out]
    held = [job.labels.disturbance in held_out for job in jobs]
    words = f"family: tuned without {', '.join(held_out)}, scored on these"
    cases = by_group(jobs, held, seeds, words)
    nominal = [job for job in jobs if job.labels.disturbance == "none" and "none" not in held_out]
    return dataclasses.replace(cases, test=cases.test + _cases(nominal, seeds.parts[2]))


def by_recordings(jobs: Sequence[Job], held_out: Sequence[str], seeds: Seeds) -> Cases:
    """Return the scenarios over other recordings than ``held_out`` (labels of data sets) to tune on."""
    held_out = [new_name("dataset", name) for name in held_out]
    held = [job.labels.dataset in held_out for job in jobs]
    return by_group(jobs, held, seeds, f"recording: tuned without {', '.join(held_out)}, scored on these")


def _cases(jobs: Sequence[Job], draws: tuple[int, ...]) -> tuple[Job, ...]:
    return tuple(dataclasses.replace(job, draws=draws) if job.scenario.seeded else job for job in jobs)


def _cut(job: Job, excerpt: Excerpt) -> Job:
    own = job.scenario
    several = [*own.plain["disturbance"], {"name": "excerpt", **dataclasses.asdict(excerpt)}]
    plain = {**own.plain, "disturbance": several}
    scenario = dataclasses.replace(own, disturbances=(*own.disturbances, excerpt), plain=plain)
    return dataclasses.replace(job, scenario=scenario)


def _span(draws: Sequence[int]) -> str:
    return f"{draws[0]} to {draws[-1]}" if draws else ""
