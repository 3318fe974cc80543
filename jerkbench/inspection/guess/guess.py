"""One guess about a table, with how sure it is and why."""

from dataclasses import dataclass
from typing import Literal

Value = str | float | tuple[str, ...]


@dataclass(frozen=True)
class Guess:
    """One guess.

    Attributes:
        parameter: of the data set table.
        value: what it is to be.
        grade: "measured" (the values say so), "named" (the column's name says so), or "unsure" (neither does).
        why: the reason, in words.
    """

    parameter: str
    value: Value
    grade: Literal["measured", "named", "unsure"]
    why: str

    def __str__(self) -> str:
        """Return it as a line that a person reads."""
        value = f"[{', '.join(self.value)}]" if isinstance(self.value, tuple) else self.value
        return f"{self.grade:<8}  {self.parameter} = {value}: {self.why}"
