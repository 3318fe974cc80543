"""Optional parts that plugins of several kinds may have."""

from collections.abc import Callable
from typing import ClassVar, Protocol, runtime_checkable

from jerkbench.recording import Recording


@runtime_checkable
class AttitudeOnly(Protocol):
    """A data set with nothing to navigate by, or a filter that runs over it all the same, if the attribute is True."""

    attitude_only: bool


@runtime_checkable
class ReadingFile(Protocol):
    """A disturbance, or a filter, that reads a file, whose content then stands in the key of a result."""

    def fingerprint(self) -> str:
        """Return a hash of the file's content; empty where this package's own code answers for it."""
        ...


@runtime_checkable
class Requiring(Protocol):
    """An attitude filter, or a filter, that does not take every recording."""

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before a sweep begins, that the recording that ``load`` returns has what the parameters ask for.

        Raises:
            RecordingError: it has not.
        """
        ...


@runtime_checkable
class Remarking(Protocol):
    """An attitude filter, or a filter, that has something to say of what it makes of a recording."""

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return sentences that a reader of the table has to know, without numbers that change from seed to seed."""
        ...


@runtime_checkable
class Cited(Protocol):
    """A plugin of any kind that brings its own BibTeX entries; without them the DOIs of its docstring are cited."""

    citations: ClassVar[tuple[str, ...]]


@runtime_checkable
class Depending(Protocol):
    """A plugin of any kind that names what it reads besides its code, so that a change of it is seen.

    Attributes:
        depends_on: files and folders, seen from the folder of its module, and environment variables as "$NAME".
    """

    depends_on: ClassVar[tuple[str, ...]]
