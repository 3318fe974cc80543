"""What is said of a job: before anything runs, of an error, and under its table."""

import os
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

import numpy as np

from jerkbench.contracts import Remarking, Requiring, has_methods
from jerkbench.errors import NO_ROOM, JerkbenchError, PluginError
from jerkbench.inspection.doctor import first_diagnoses
from jerkbench.io.sanitiser import imu_gap_notes
from jerkbench.jobs.inputs import Inputs
from jerkbench.jobs.job import Job
from jerkbench.notices import plain
from jerkbench.plugins import is_own
from jerkbench.recording import Recording


def require_inputs(job: Job, checked: set[tuple[object, object]]) -> None:
    """Ask attitude filter and filter whether the recording of the first seed has what they need.

    Args:
        job: the combination; its recording is loaded only if one of them has such a question.
        checked: data sets with the parts that were asked before; grows.

    Raises:
        JerkbenchError: the recording lacks an input, or there is no recording.
    """
    for part in (job.scenario.attitude, job.method.filter):
        if isinstance(part, Requiring) and (job.scenario.dataset, part) not in checked:
            try:
                part.require(lambda: job.scenario.dataset.load(job.draws[0]))
            except JerkbenchError:
                raise
            except Exception:  # noqa: BLE001, S110 - a plugin that breaks becomes a row that says so, when it is run
                pass
            checked.add((job.scenario.dataset, part))


TRACEBACK = "JERKBENCH_TRACEBACK"
"""Environment variable: what a plugin raises in a single run is raised as it is, for its author."""


def reason_of(error: Exception) -> str:
    """Return the exception, and where it was raised."""
    if isinstance(error, np.linalg.LinAlgError):
        return (
            f"a matrix is singular, or not positive definite, to working precision ({error}); check the covariances of"
            " the measurements (`jerkbench data inspect`) and the parameters of filter and adaptation"
        )
    at = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({at.name}, line {at.lineno})"


@contextmanager
def plugins_in_words(job: Job) -> Iterator[None]:
    """Raise the exceptions of a plugin as `PluginError`, except for errors of jerkbench and a full disk.

    Raises:
        PluginError: the plugin raised an exception, and the environment variable `TRACEBACK` is not set.
    """
    try:
        yield
    except JerkbenchError:
        raise
    except Exception as error:
        if os.environ.get(TRACEBACK) or (isinstance(error, OSError) and error.errno in NO_ROOM):
            raise
        culprit, why = _culprit(job, error), reason_of(error)
        raise PluginError(f"{culprit} failed: {why}. Set {TRACEBACK}=1 to see the whole traceback.") from error


def _culprit(job: Job, error: Exception) -> str:
    """The plugin in whose method it was raised; where in none, as of a wrong result, those that may have caused it.

    The engine is never blamed: it runs the others.
    """
    named = [(f"{kind} {name}", plugin) for kind, name, plugin in job.parts() if kind != "engine"]
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for frame in reversed(frames):
        own = frame.f_locals.get("self")
        if names := [name for name, plugin in named if plugin is own]:
            return f"The {names[0]}"
    return f"The filter {job.spec['filter']['name']} with the adaptation {job.spec['adaptation']['name']}"


def unfit(job: Job) -> str:
    """Return what is the matter with the first plugin of ``job`` that does not keep its contract, or nothing."""
    return next((sentence for _, sentence in _complaints(job)), "")


def _complaints(job: Job) -> Iterator[tuple[str, str]]:
    """Kind and name of each plugin from elsewhere that does not keep its contract, and what is the matter."""
    for kind, name, plugin in job.parts():
        if not is_own(type(plugin)):
            from jerkbench.plugins.checks import complaint

            if sentence := complaint(kind, plugin):
                yield f"{kind} {name}", sentence


# What is said before anything runs.


def first_complaints(jobs: Iterable[Job]) -> list[str]:
    """Return a sentence for each plugin of ``jobs`` whose runs will fail, because it does not keep its contract."""
    complaints = dict(complaint for job in jobs for complaint in _complaints(job))
    return [f"Every run with the {title} will fail: {sentence}" for title, sentence in complaints.items()]


def first_remarks(jobs: Sequence[Job], inputs: Inputs) -> list[str]:
    """Return what is to be said of recorded drives before they run: what is surely wrong, and remarks on the attitude.

    `data inspect` finds more mistakes. Simulated drives are remarked on under the table.
    """
    recorded = [job for job in jobs if not job.scenario.dataset.seeded]
    drives = {job.scenario.dataset: job for job in recorded}
    firsts: dict[object, Job] = {}
    for job in recorded:
        firsts.setdefault(job.scenario, job)
    mistakes, remarks = list[str](), list[str]()
    for job in drives.values():
        with suppress(Exception):  # what cannot be loaded becomes a row that says so, when it is run
            drive = inputs.undisturbed(job.scenario.dataset, job.draws[0])
            mistakes += [f"{_name(job)}: {diagnosis}" for diagnosis in first_diagnoses(drive)]
    for job in firsts.values():
        if isinstance(job.scenario.attitude, Remarking):
            with suppress(Exception):  # as above
                remarks += _remarks(job, inputs.recording(job.scenario, job.draws[0]))
    return [*mistakes, *dict.fromkeys(remarks)]


# The notes on a job: where the reference comes from, what the recording and its filters have to
# say.


def notes_of(job: Job, recording: Recording) -> list[str]:
    """Return what stands under the table of a job; once for all its parameters."""
    return [plain(note) for note in (*_reference_notes(job, recording), *_remarks(job, recording))]


def _reference_notes(job: Job, recording: Recording) -> list[str]:
    reference, name = recording.reference, _name(job)
    notes = [f"{name}: {note}" for note in (*recording.notes, *imu_gap_notes(recording.imu))]
    if reference.empty:
        return [f"{name} has no reference: {reference.source}.", *notes]
    independence = "independent of" if reference.independent else "not independent of"
    return [f"Reference of {name}: {reference.source}; {independence} the measurements.", *notes]


def _remarks(job: Job, recording: Recording) -> list[str]:
    of_attitude, of_filter = (
        part.remarks(recording) if has_methods(part, Remarking) else ()
        for part in (job.scenario.attitude, job.method.filter)
    )
    return [*(f"{_name(job)}: {remark}" for remark in of_attitude), *of_filter]


def _name(job: Job) -> str:
    """The data set's name, without its parameters."""
    return job.labels.dataset.partition("(")[0]
