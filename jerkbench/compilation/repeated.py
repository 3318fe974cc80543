"""A loop that the compiler is made to write out: only then does it see that a row read is not the row written."""

from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType
from typing import Any


@dataclass(frozen=True)
class Repeated:
    """Calls ``function(w, 0)``, ``function(w, 1)``, ...; `jitted` writes the calls out one by one, inlined.

    Attributes:
        function: what is called.
        module: globals of the module that holds the number of calls ...
        count: ... under this name, which a compilation may replace; or the number itself.
    """

    function: Callable[[Any, int], None]
    module: dict[str, Any]
    count: str | int

    def __call__(self, w: Any) -> None:  # noqa: ANN401 - whatever the function takes
        """Run the loop in plain Python."""
        for k in range(self.times({})):
            self.function(w, k)

    def times(self, constants: dict[str, Any]) -> int:
        """Return the number of calls under ``constants``."""
        return int({**self.module, **constants}[self.count] if isinstance(self.count, str) else self.count)

    def written_out(self, times: int) -> FunctionType:
        """Return a function of w with that many calls of the global ``function``."""
        scope: dict[str, Any] = {"function": self.function}
        lines = "".join(f"    function(w, {k})\n" for k in range(times))
        exec(f"def repeated(w):\n{lines}", scope)  # noqa: S102 - the text is made here, of numbers only
        made: FunctionType = scope["repeated"]
        made.__module__ = self.function.__module__
        return made
