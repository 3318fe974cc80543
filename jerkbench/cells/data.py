"""The identity of a cell's data: those of its data set, and files that its disturbances read."""

from collections.abc import Sequence

from jerkbench.contracts import Dataset, Disturbance, ReadingFile
from jerkbench.errors import RecordingError


def data_fingerprint(dataset: Dataset, disturbances: Sequence[Disturbance]) -> str:
    """Return the fingerprint of the data set, and that of each disturbance that reads a file after it."""
    marks = [d.fingerprint() for d in disturbances if isinstance(d, ReadingFile)]
    return "+".join([dataset.fingerprint(), *filter(None, marks)])


def require_data(dataset: Dataset, disturbances: Sequence[Disturbance], fingerprint: str) -> None:
    """Require that the data are still those of ``fingerprint``.

    Raises:
        RecordingError: they are others.
    """
    current = data_fingerprint(dataset, disturbances)
    if current != fingerprint:
        raise RecordingError(
            f"The data of the data set {type(dataset).__name__} have changed since they were hashed: the hash was "
            f"{fingerprint or 'empty'}, it is {current or 'empty'}. `jerkbench run` with the same words runs it with "
            "the data that are there now."
        )
