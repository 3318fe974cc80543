"""The split of the runs of a tuning into tuning cases, validation cases and test cases.

The search never uses the test cases.
"""

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
from jerkbench.report.labels import REUSED

STREAMS = ("imu", "position", "velocity", "heading", "reference")
MIN_ROWS = 2
"""Minimum number of rows of a stream. With fewer rows, nothing can be estimated."""


@dataclass(frozen=True)
class Excerpt:
    """A disturbance that restricts a recording to the part before or after a time.

    Attributes:
        share: Fraction of the duration at which the recording is divided [-].
        late: If False, the recording ends at the time of the division. If ``late`` is True, the complete recording is
            used, but errors before the time of the division are not counted.
    """

    seeded: ClassVar[bool] = False

    share: float
    late: bool

    def apply(self, recording: Recording, seed: int) -> Recording:  # noqa: ARG002 - the contract of a disturbance
        """Return the first part of the recording, or the complete recording without scoring its first part.

        Raises:
            RecordingError: A stream of the first part has fewer than `MIN_ROWS` rows.
        """
        at_s, reference = self.share * recording.duration_s, recording.reference
        if self.late:
            return replace(recording, reference=replace(reference, scored=reference.scored & (reference.t_s >= at_s)))
        streams = {name: stream for name in STREAMS if (stream := getattr(recording, name)) is not None}
        early = {name: _first_rows(stream, at_s, recording.name) for name, stream in streams.items()}
        outages_s = recording.outages_s[recording.outages_s[:, 0] < at_s]
        return replace(recording, **early, outages_s=np.minimum(outages_s, at_s))

    def replicates(self) -> int:
        """Return 1, because the disturbance is not random and has no phases."""
        return 1


def _first_rows(stream: Any, end_s: float, recording: str) -> Any:  # noqa: ANN401 - any stream
    count = int(np.searchsorted(stream.t_s, end_s, side="right"))
    if count < MIN_ROWS:
        rows = f"{count} rows of {type(stream).__name__}"
        raise RecordingError(f"The part of {recording} for tuning has {rows}, but needs {MIN_ROWS}; increase share.")
    arrays = {key: value for key, value in vars(stream).items() if isinstance(value, np.ndarray)}
    return replace(stream, **{key: value[:count] for key, value in arrays.items() if len(value) == len(stream.t_s)})


@dataclass(frozen=True)
class Seeds:
    """The numbers of seeds for tuning, validation and test. The three ranges of seeds are consecutive and disjoint.

    Attributes:
        tune: Number of seeds with which the search evaluates every candidate setting.
        choose: Number of seeds for the validation of the best settings. Validation is omitted if this number is 0.
        test: Number of seeds for the test.
        first: The first seed for tuning.
    """

    tune: int = 16
    choose: int = 16
    test: int = 40
    first: int = 0

    def __post_init__(self) -> None:
        given = f"tune_seeds is {self.tune}, choose_seeds is {self.choose}, test_seeds is {self.test}"
        given = f"{given} and first_seed is {self.first}"
        if self.tune < 1 or self.test < 1 or self.choose < 0 or self.first < 0:
            raise PluginError(f"{given}; tune_seeds and test_seeds must be at least 1, and no value may be negative.")
        if max(self.tune, self.choose, self.test) > MAX_RUNS:
            raise PluginError(f"{given}; each number of seeds must be at most {MAX_RUNS}.")

    @property
    def parts(self) -> tuple[range, range, range]:
        """The seeds for tuning, for validation and for the test."""
        choose, test = self.first + self.tune, self.first + self.tune + self.choose
        return range(self.first, choose), range(choose, test), range(test, test + self.test)

    def __str__(self) -> str:
        tune, choose, test = (f"{part[0]} to {part[-1]}" if part else "none" for part in self.parts)
        return f"seeds {tune} to tune, {choose} to choose, {test} to test"


@dataclass(frozen=True, eq=False)
class Cases:
    """The cases of a tuning. A case is a scenario with its seeds.

    Attributes:
        tune: The cases on which the search evaluates every candidate setting.
        choose: The validation cases, on which the best settings are evaluated again. If ``choose`` is empty, the
            setting with the lowest loss on ``tune`` is selected.
        test: The cases on which the selected setting is scored.
        split: Description of the split into tuning, validation and test cases.
    """

    tune: tuple[Job, ...]
    choose: tuple[Job, ...]
    test: tuple[Job, ...]
    split: str

    @property
    def next_seed(self) -> int | None:
        """The first seed after all seeds of the tuning, or None if no case is random."""
        used = [case.draws[-1] for case in (*self.tune, *self.choose, *self.test) if case.scenario.seeded]
        return max(used) + 1 if used else None


def require_one_method(jobs: Sequence[Job]) -> None:
    """Raise an exception unless all jobs have the same method.

    Raises:
        PluginError: The jobs differ in the filter, the adaptation, the scale of R or the engine.
    """
    for name in ("filter", "adaptation", "r_scale", "engine"):
        if any(getattr(job.method, name) != getattr(jobs[0].method, name) for job in jobs):
            raise PluginError(f"The scenarios have different values of {name}; tune one method at a time.")


def by_seeds(jobs: Sequence[Job], seeds: Seeds) -> Cases:
    """Return tuning, validation and test cases that have the same scenarios but different seeds.

    Raises:
        PluginError: A scenario has no random part, or the jobs have different methods.
    """
    require_one_method(jobs)
    for job in jobs:
        if not job.scenario.seeded:
            scenario = f"{job.labels.dataset} with the disturbance {job.labels.disturbance}"
            raise PluginError(f"{scenario} is not random, so seeds have no effect; use split=time or split=recordings.")
    of_tune, of_choose, of_test = (_with_seeds(jobs, part) for part in seeds.parts)
    return Cases(of_tune, of_choose, of_test, str(seeds))


def by_time(jobs: Sequence[Job], seeds: Seeds, share: float = 0.5) -> Cases:
    """Return cases for tuning on the first part of each recording, and for the test on the rest of the recording.

    For tuning, a recording ends at the fraction ``share`` of its duration. For the test, the complete recording is
    used, but errors before the fraction ``share`` of the duration are not counted.
    """
    require_one_method(jobs)
    if not 0 < share < 1:
        raise PluginError(f"share is {share:g}; give the fraction of each recording to tune on, between 0 and 1.")
    parts = ([_with_excerpt(job, Excerpt(share, late)) for job in jobs] for late in (False, True))
    tune, test = (_with_seeds(part, seeds.parts[0]) for part in parts)
    return Cases(tune, (), test, f"the first {100 * share:g} % of the time to tune, the rest to test")


def by_label(jobs: Sequence[Job], kind: str, held_out: Sequence[str], seeds: Seeds) -> Cases:
    """Return cases for tuning on some scenarios, and for the test on scenarios with a held-out data set or disturbance.

    If disturbances are held out, the disturbance `none` is used for tuning and for the test, because a good setting
    also has to be accurate without faults.

    Args:
        jobs: The jobs of all scenarios, with the same method.
        kind: The label that divides the scenarios: "dataset" or "disturbance".
        held_out: Labels of the held-out data sets or disturbances.
        seeds: The seeds of the scenarios with random parts.

    Raises:
        PluginError: No scenario is held out, or all scenarios are held out.
    """
    require_one_method(jobs)
    held_out = [new_name(kind, name) for name in held_out]
    seen = [job for job in jobs if getattr(job.labels, kind) not in held_out]
    unseen = [job for job in jobs if getattr(job.labels, kind) in held_out]
    names = ", ".join(held_out)
    split = f"{'recording' if kind == 'dataset' else 'family'}: tuned without {names}, scored on these"
    if not seen or not unseen:
        sides = f"{len(seen)} scenarios for tuning and {len(unseen)} for the test"
        raise PluginError(f"held_out=[{names}] leaves {sides}; each part needs at least one scenario.")
    tune, choose, test = seeds.parts
    choosing = seen if choose and all(job.scenario.seeded for job in seen) else []
    if any(job.scenario.seeded for job in jobs):
        split = f"{split}; {seeds}"
    without_fault = [job for job in seen if kind == "disturbance" and job.labels.disturbance == "none"]
    tested = [*unseen, *without_fault]
    return Cases(_with_seeds(seen, tune), _with_seeds(choosing, choose), _with_seeds(tested, test), split)


_SEEDS_OF_SPLIT = re.compile(r"seeds (\d+) to (\d+) to tune, (?:\d+ to (\d+)|none) to choose, \d+ to (\d+) to test")


def reused_seeds(notes: Iterable[str], jobs: Sequence[Job]) -> list[str]:
    """Return a message for each tuning whose seeds for tuning or validation are among the seeds of the jobs.

    Args:
        notes: Notes of presets, which contain the seeds of their tunings.
        jobs: The jobs to check.
    """
    seeds = {seed for job in jobs if job.scenario.seeded for seed in job.draws}
    messages = []
    splits = dict.fromkeys(match.groups() for note in notes for match in _SEEDS_OF_SPLIT.finditer(note))
    for first, tuned, selected, tested in splits:
        last = int(selected or tuned)
        if shared := seeds.intersection(range(int(first), last + 1)):
            reused = f"{REUSED}{first} to {last}, and {len(shared)} of them are run again"
            unused = f"Give first_seed={int(tested) + 1} for seeds that the tuning has not used"
            messages.append(f"{reused}, so the errors are too optimistic. {unused}.")
    return messages


def _with_seeds(jobs: Sequence[Job], seeds: Sequence[int]) -> tuple[Job, ...]:
    """Return the jobs with other seeds, or no jobs if ``seeds`` is empty. Jobs without random parts are unchanged."""
    return tuple(replace(job, draws=seeds) if job.scenario.seeded else job for job in jobs if seeds)


def _with_excerpt(job: Job, excerpt: Excerpt) -> Job:
    scenario = job.scenario
    disturbances = [*scenario.plain["disturbance"], {"name": "excerpt", **dataclasses.asdict(excerpt)}]
    plain = {**scenario.plain, "disturbance": disturbances}
    cut = replace(scenario, disturbances=(*scenario.disturbances, excerpt), plain=plain)
    return replace(job, scenario=cut)
