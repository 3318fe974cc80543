"""One mistake in a recording, with what was measured and what would mend it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Diagnosis:
    """One mistake.

    Attributes:
        name: short, for tables: "accelerometer in g".
        measured: what was measured, with its unit.
        sentence: what it means.
        remedy: the parameter that would mend it.
    """

    name: str
    measured: str
    sentence: str
    remedy: str

    def __str__(self) -> str:
        """Return all in a line that a person reads."""
        return f"{self.sentence}: {self.measured}. {self.remedy}."
