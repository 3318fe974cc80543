"""The condition of a check, and the sentence about a plugin that changes itself."""

from dataclasses import FrozenInstanceError


class Unfit(AssertionError):  # noqa: N818 - pytest shows an assertion's sentence best
    """Something that a plugin promises and does not keep; other assertions are the plugin's own."""


def require(ok: object, sentence: str) -> None:
    """Raise an `Unfit` with ``sentence`` unless ``ok``; unlike `assert` also under ``python -O``."""
    if not ok:
        raise Unfit(sentence)


def changes_itself(plugin: object, error: FrozenInstanceError) -> str:
    """Return the sentence about a plugin that sets an attribute of its own while it runs."""
    name = str(error).rpartition(" ")[2].strip("'")
    return (
        f"{type(plugin).__name__} sets self.{name} while it runs, but a plugin never changes; what an adaptation keeps"
        " from one update to the next stands in memory, all else in local variables."
    )
