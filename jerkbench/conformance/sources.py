"""The checks of a data set and of a disturbance."""

from typing import Any

from jerkbench.conformance.methods import require_methods
from jerkbench.conformance.recordings import small_recording
from jerkbench.conformance.require import require
from jerkbench.conformance.same import identical, pure_result
from jerkbench.optional import is_attitude_only
from jerkbench.recording import Recording

LONG_S = 600.0
"""Disturbances put several bursts or outages into a recording; they need room."""


def check_dataset(plugin: Any) -> None:  # noqa: ANN401 - the plugin under test
    """Check a data set.

    Raises:
        AssertionError: it loads something that is no recording, is not repeatable, or lies about ``seeded``.
    """
    subject = type(plugin).__name__
    require_methods("dataset", plugin)
    first = pure_result(f"{subject}.load(0)", plugin.load, 0)
    require(isinstance(first, Recording), f"{subject}.load() gives a {type(first).__name__}; it must be a Recording.")
    _check_positions(subject, plugin, first)
    mark = pure_result(f"{subject}.fingerprint()", plugin.fingerprint)
    require(isinstance(mark, str), f"{subject}.fingerprint() is {mark!r}; it must be a string.")
    alike = identical(first, plugin.load(1))
    require(alike or plugin.seeded, f"{subject}.load() depends on the seed, but its seeded is False.")
    require(
        not alike or not plugin.seeded, f"{subject}.load() gives the same for seeds 0 and 1, but its seeded is True."
    )


def _check_positions(subject: str, plugin: Any, recording: Recording) -> None:  # noqa: ANN401 - as above
    """Only a data set that says so has no positions."""
    without = is_attitude_only(plugin)
    require(
        without or recording.position is not None,
        f"{subject}.load() gives no positions; a filter has nothing to start from. If there are none, say so with a"
        " class attribute attitude_only = True.",
    )


def check_disturbance(plugin: Any) -> None:  # noqa: ANN401 - as above
    """Check a disturbance on a small recording, with and without its optional parts.

    Raises:
        AssertionError: it returns no recording, changes its input, is not repeatable, or lies about ``seeded`` or
            ``replicates``.
    """
    subject = type(plugin).__name__
    require_methods("disturbance", plugin)
    n = plugin.replicates()
    require(isinstance(n, int), f"{subject}.replicates() is {n!r}; it must be a whole number.")
    require(n >= 1, f"{subject}.replicates() is {n}; it must be at least 1.")
    recording = small_recording(LONG_S)
    for seed in (0, 3):
        first = checked_disturbance(subject, plugin, recording, seed)
        if not plugin.seeded:
            require(
                identical(first, plugin.apply(recording, seed + n)),
                f"{subject}.apply() gives different results for seeds {seed} and {seed + n}, but it is not seeded and"
                f" has {n} replicates.",
            )


def checked_disturbance(subject: str, plugin: Any, recording: Recording, seed: int) -> Recording:  # noqa: ANN401 - as above
    """Return the disturbed recording, checked for being one, and for being the same the second time."""
    result = pure_result(f"{subject}.apply()", plugin.apply, recording, seed)
    require(
        isinstance(result, Recording), f"{subject}.apply() gives a {type(result).__name__}; it must be a Recording."
    )
    return result  # type: ignore[no-any-return]  # it was asked
