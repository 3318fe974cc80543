"""The cases of a tuning: runs to try settings on, to choose on, and to test on, which the search never uses."""

import dataclasses
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from jerkbench.errors import PluginError, RecordingError
from jerkbench.jobs.job import MAX_RUNS, Job
from jerkbench.recording import Recording
from jerkbench.renamed import new_name

STREAMS = ("imu", "position", "velocity", "heading", "reference")
MIN_ROWS = 2
"""Rows of a stream without which nothing can be estimated."""


@dataclass(frozen=True)
class Excerpt:
    """The part of a recording before or after a time.

    Attributes:
        share: fraction of the duration at which the two parts meet [-].
        late: whether errors count from there on, over the complete recording; otherwise the recording ends there.
    """

    seeded: ClassVar[bool] = False

    share: float
    late: bool

    def apply(self, recording: Recording, seed: int) -> Recording:  # noqa: ARG002 - the contract of a disturbance
        """Return the part.

        Raises:
            RecordingError: A stream of the first part has fewer than two rows.
        """
        at_s, reference = self.share * recording.duration_s, recording.reference
        if self.late:
            return replace(recording, reference=replace(reference, scored=reference.scored & (reference.t_s >= at_s)))
        streams = {name: stream for name in STREAMS if (stream := getattr(recording, name)) is not None}
        early = {name: _first_rows(stream, at_s, recording.name) for name, stream in streams.items()}
        outages_s = recording.outages_s[recording.outages_s[:, 0] < at_s]
        return replace(recording, **early, outages_s=np.minimum(outages_s, at_s))

    def replicates(self) -> int:
        """Return 1."""
        return 1


def _first_rows(stream: Any, end_s: float, recording: str) -> Any:  # noqa: ANN401 - any stream
    count = int(np.searchsorted(stream.t_s, end_s, side="right"))
    if count < MIN_ROWS:
        raise RecordingError(
            f"{recording} has {count} rows of {type(stream).__name__} before the end of the part to tune on; take a"
            " larger share of the time."
        )
    arrays = {key: value for key, value in vars(stream).items() if isinstance(value, np.ndarray)}
    return replace(stream, **{key: value[:count] for key, value in arrays.items() if len(value) == len(stream.t_s)})


@dataclass(frozen=True)
class Seeds:
    """Numbers of seeds. The parts are consecutive from ``first``, so that no two share a seed.

    Attributes:
        tune: seeds to try every setting on.
        choose: seeds to choose among the best settings on; 0: none.
        test: seeds to test on.
        first: the first seed.
    """

    tune: int = 16
    choose: int = 16
    test: int = 40
    first: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        given = (
            f"tune_seeds is {self.tune}, choose_seeds {self.choose}, test_seeds {self.test} and first_seed {self.first}"
        )
        if self.tune < 1 or self.test < 1 or self.choose < 0 or self.first < 0:
            raise PluginError(f"{given}; at least one seed to tune and one to test are needed, and none is negative.")
        if max(self.tune, self.choose, self.test) > MAX_RUNS:
            raise PluginError(f"{given}; give at most {MAX_RUNS} of each.")

    @property
    def parts(self) -> tuple[range, range, range]:
        """The seeds to tune, to choose and to test on."""
        choose, test = self.first + self.tune, self.first + self.tune + self.choose
        return range(self.first, choose), range(choose, test), range(test, test + self.test)

    def __str__(self) -> str:
        """Return the first and the last seed of each part."""
        tune, choose, test = (f"{part[0]} to {part[-1]}" if part else "none" for part in self.parts)
        return f"seeds {tune} to tune, {choose} to choose, {test} to test"


@dataclass(frozen=True, eq=False)
class Cases:
    """The cases of a tuning: scenarios with their seeds.

    Attributes:
        tune: cases on which every setting is tried.
        choose: cases on which one of the best settings is chosen; empty: the best on ``tune`` is taken.
        test: cases on which the chosen setting is tested.
        split: description of the split.
    """

    tune: tuple[Job, ...]
    choose: tuple[Job, ...]
    test: tuple[Job, ...]
    split: str

    @property
    def next_seed(self) -> int | None:
        """The first seed after all seeds of the tuning; None if nothing is random."""
        used = [case.draws[-1] for case in (*self.tune, *self.choose, *self.test) if case.scenario.seeded]
        return max(used) + 1 if used else None


def require_one_method(jobs: Sequence[Job]) -> None:
    """Check that there are scenarios, all with the same method.

    Raises:
        PluginError: There are no scenarios, or they differ in filter, adaptation, noise or engine.
    """
    if not jobs:
        raise PluginError("There is no scenario to tune on; give dataset=... and disturbance=...")
    for name in ("filter", "adaptation", "r_scale", "engine"):
        if any(getattr(job.method, name) != getattr(jobs[0].method, name) for job in jobs):
            raise PluginError(f"A tuning is of one method, but its scenarios have different values of {name}.")


def by_seeds(jobs: Sequence[Job], seeds: Seeds) -> Cases:
    """Return the same scenarios with different seeds.

    Raises:
        PluginError: Nothing in a scenario is random.
    """
    require_one_method(jobs)
    for job in jobs:
        if not job.scenario.seeded:
            raise PluginError(
                f"Nothing in {job.labels.dataset} with {job.labels.disturbance} is random, so other seeds would be"
                " the same run: use split=time, or split=recordings."
            )
    of_tune, of_choose, of_test = (_with_seeds(jobs, part) for part in seeds.parts)
    return Cases(of_tune, of_choose, of_test, str(seeds))


def by_time(jobs: Sequence[Job], seeds: Seeds, share: float = 0.5) -> Cases:
    """Return the first part of each recording to tune on, and the rest to test on.

    A recording to tune on ends at ``share`` of its duration. The test runs over the complete recording, and errors
    count from there on.
    """
    require_one_method(jobs)
    if not 0 < share < 1:
        raise PluginError(f"The share of the time to tune on is {share:g}; it must lie between 0 and 1.")
    tune, test = (
        _with_seeds([_with_excerpt(job, Excerpt(share, late)) for job in jobs], seeds.parts[0])
        for late in (False, True)
    )
    return Cases(tune, (), test, f"the first {100 * share:g} % of the time to tune, the rest to test")


def by_label(jobs: Sequence[Job], kind: str, held_out: Sequence[str], seeds: Seeds) -> Cases:
    """Return scenarios to tune on, and those with a held out data set or disturbance to test on.

    The disturbance `none` is on both sides, because a setting has to be good without a fault, too.

    Args:
        jobs: The scenarios.
        kind: "dataset" or "disturbance".
        held_out: Labels of that kind.
        seeds: Seeds of the scenarios with anything random.

    Raises:
        PluginError: One of the sides is empty.
    """
    require_one_method(jobs)
    held_out = [new_name(kind, name) for name in held_out]
    seen = [job for job in jobs if getattr(job.labels, kind) not in held_out]
    unseen = [job for job in jobs if getattr(job.labels, kind) in held_out]
    names = ", ".join(held_out)
    split = f"{'recording' if kind == 'dataset' else 'family'}: tuned without {names}, scored on these"
    if not seen or not unseen:
        raise PluginError(f"A split by {split} needs scenarios on both sides; there are {len(seen)} and {len(unseen)}.")
    tune, choose, test = seeds.parts
    chosen = seen if choose and all(job.scenario.seeded for job in seen) else []
    if any(job.scenario.seeded for job in jobs):
        split = f"{split}; {seeds}"
    without_fault = [job for job in seen if kind == "disturbance" and job.labels.disturbance == "none"]
    return Cases(
        _with_seeds(seen, tune), _with_seeds(chosen, choose), _with_seeds([*unseen, *without_fault], test), split
    )


_SEEDS_OF_SPLIT = re.compile(r"seeds (\d+) to (\d+) to tune, (?:\d+ to (\d+)|none) to choose, \d+ to (\d+) to test")


def reused_seeds(notes: Iterable[str], jobs: Sequence[Job]) -> list[str]:
    """Return a message for each tuning, described by its note, that tuned or chose a setting on seeds of the jobs."""
    seeds = {seed for job in jobs if job.scenario.seeded for seed in job.draws}
    messages = []
    for first, tuned, chosen, tested in dict.fromkeys(
        m.groups() for note in notes for m in _SEEDS_OF_SPLIT.finditer(note)
    ):
        last = int(chosen or tuned)
        if shared := seeds.intersection(range(int(first), last + 1)):
            messages.append(
                f"The presets were tuned on the seeds {first} to {last}, and {len(shared)} of them are run again, so"
                f" the errors are too optimistic. Give first_seed={int(tested) + 1} for seeds that the tuning has not"
                " used."
            )
    return messages


def _with_seeds(jobs: Sequence[Job], seeds: Sequence[int]) -> tuple[Job, ...]:
    """The jobs, or none if there are no seeds; a job without anything random keeps its phases."""
    return tuple(replace(job, draws=seeds) if job.scenario.seeded else job for job in jobs if seeds)


def _with_excerpt(job: Job, excerpt: Excerpt) -> Job:
    scenario = job.scenario
    disturbances = [*scenario.plain["disturbance"], {"name": "excerpt", **dataclasses.asdict(excerpt)}]
    plain = {**scenario.plain, "disturbance": disturbances}
    cut = replace(scenario, disturbances=(*scenario.disturbances, excerpt), plain=plain)
    return replace(job, scenario=cut)
