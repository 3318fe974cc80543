"""Messages about a job: warnings before the run, error messages, and notes below the table."""

import os
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

import numpy as np

from jerkbench.contracts import Remarking, Requiring, has_methods
from jerkbench.errors import DISK_FULL, JerkbenchError, PluginError
from jerkbench.inspection.diagnostics import first_diagnoses
from jerkbench.io.sanitiser import imu_gap_notes
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.notices import plain
from jerkbench.plugins import is_builtin
from jerkbench.recording import Recording
from jerkbench.report.labels import bare


def require_inputs(job: Job, checked: set[tuple[object, object]]) -> None:
    """Check that the recording of the first seed has the inputs that the attitude and the navigation filter require.

    Args:
        job: The job, whose recording is loaded only if one of the two filters has requirements.
        checked: Pairs of a data set and a filter that are already checked. The function adds the pairs of ``job`` to
            this set.

    Raises:
        JerkbenchError: The recording does not exist, or lacks an input that a filter requires.
    """
    for part in (job.scenario.attitude, job.method.filter):
        if has_methods(part, Requiring) and (job.scenario.dataset, part) not in checked:
            try:
                part.require(lambda: job.scenario.dataset.load(job.draws[0]))
            except JerkbenchError:
                raise
            except Exception:  # noqa: BLE001, S110 - the run raises it again, and its row gets the status "failed"
                pass
            checked.add((job.scenario.dataset, part))


TRACEBACK = "JERKBENCH_TRACEBACK"
"""Environment variable for authors of plugins. If set, a single run raises the original exception of a plugin."""


def reason_of(error: Exception) -> str:
    """Return the text of an exception, with the name of the function and the number of the line that raised it."""
    if isinstance(error, np.linalg.LinAlgError):
        check = "check the covariances of the measurements (`jerkbench data inspect`) and the parameters of the method"
        return f"a matrix is singular, or not positive definite, to working precision ({error}); {check}"
    at = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({at.name}, line {at.lineno})"


@contextmanager
def plugin_errors(job: Job) -> Iterator[None]:
    """Convert exceptions of a plugin to `PluginError`.

    Errors of jerkbench, and errors because the disk is full, are raised unchanged.

    Raises:
        PluginError: A plugin raised an exception, and the environment variable `TRACEBACK` is not set.
    """
    try:
        yield
    except JerkbenchError:
        raise
    except Exception as error:
        if os.environ.get(TRACEBACK) or (isinstance(error, OSError) and error.errno in DISK_FULL):
            raise
        culprit, why = _culprit(job, error), reason_of(error)
        raise PluginError(f"{culprit} failed: {why}. Set {TRACEBACK}=1 to see the traceback.") from error


def _culprit(job: Job, error: Exception) -> str:
    """Return the kind and name of the plugin whose method raised the exception.

    If the traceback contains no method of a plugin, the result names the filter and the adaptation. The result never
    names the engine, because the engine calls the other plugins.
    """
    named = [(f"{kind} {name}", plugin) for kind, name, plugin in job.parts() if kind != "engine"]
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for frame in reversed(frames):
        instance = frame.f_locals.get("self")
        if names := [name for name, plugin in named if plugin is instance]:
            return f"The {names[0]}"
    return f"The filter {job.spec['filter']['name']} with the adaptation {job.spec['adaptation']['name']}"


def unfit(job: Job) -> str:
    """Return a message about the first plugin of the job that violates its contract, or an empty string."""
    return next((message for _, message in _complaints(job)), "")


def _complaints(job: Job) -> Iterator[tuple[str, str]]:
    """Yield a name ("KIND NAME") and a message for each plugin of another package that violates its contract."""
    for kind, name, plugin in job.parts():
        if not is_builtin(type(plugin)):
            from jerkbench.plugins.checks import complaint

            if message := complaint(kind, plugin):
                yield f"{kind} {name}", message


# Warnings before the first run.


def first_complaints(jobs: Iterable[Job]) -> list[str]:
    """Return a warning for each plugin of ``jobs`` that violates its contract.

    All runs that use a plugin with a warning will fail.
    """
    complaints = dict(complaint for job in jobs for complaint in _complaints(job))
    return [f"Every run with the {title} will fail: {message}" for title, message in complaints.items()]


def first_notes(jobs: Sequence[Job]) -> list[str]:
    """Return warnings about obvious mistakes in the recordings of a sweep, and the notes of the attitude filters.

    The command `data inspect` finds more mistakes. Simulated recordings are not checked, and notes about simulated
    recordings are printed below the table instead.
    """
    inputs, recorded = shared_inputs(), [job for job in jobs if not job.scenario.dataset.seeded]
    drives = {job.scenario.dataset: job for job in recorded}
    firsts: dict[object, Job] = {}
    for job in recorded:
        firsts.setdefault(job.scenario, job)
    mistakes, remarks = list[str](), list[str]()
    for job in drives.values():
        with suppress(Exception):  # the run raises the exception again, and its row gets the status "failed"
            drive = inputs.undisturbed(job.scenario.dataset, job.draws[0])
            mistakes += [f"{bare(job.labels.dataset)}: {diagnosis}" for diagnosis in first_diagnoses(drive)]
    for job in firsts.values():
        if isinstance(job.scenario.attitude, Remarking):
            with suppress(Exception):  # the run raises the exception again
                remarks += _remarks(job, inputs.recording(job.scenario, job.draws[0]))
    return [*mistakes, *dict.fromkeys(remarks)]


# The notes below a table describe the reference and the recording, and include the notes of both filters.


def notes_of(job: Job, recording: Recording) -> list[str]:
    """Return the notes that are printed below the table of a job."""
    return [plain(note) for note in (*_reference_notes(job, recording), *_remarks(job, recording))]


def _reference_notes(job: Job, recording: Recording) -> list[str]:
    reference, name = recording.reference, bare(job.labels.dataset)
    notes = [f"{name}: {note}" for note in (*recording.notes, *imu_gap_notes(recording.imu))]
    if reference.empty:
        return [f"{name} has no reference: {reference.source}.", *notes]
    independence = "independent of" if reference.independent else "not independent of"
    return [f"Reference of {name}: {reference.source}; {independence} the measurements.", *notes]


def _remarks(job: Job, recording: Recording) -> list[str]:
    parts = job.scenario.attitude, job.method.filter
    of_attitude, of_filter = (part.remarks(recording) if has_methods(part, Remarking) else () for part in parts)
    return [*(f"{bare(job.labels.dataset)}: {note}" for note in of_attitude), *of_filter]
