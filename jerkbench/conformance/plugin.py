"""The checks of a plugin of any kind."""

import dataclasses
import inspect
import pickle
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from jerkbench.conformance.adaptation import check_adaptation
from jerkbench.conformance.attitude import check_attitude
from jerkbench.conformance.engine import check_engine
from jerkbench.conformance.kinematic import check_filter
from jerkbench.conformance.methods import require_methods
from jerkbench.conformance.metric import check_metric
from jerkbench.conformance.require import require
from jerkbench.conformance.sources import check_dataset, check_disturbance
from jerkbench.errors import PluginError, unknown
from jerkbench.parameters import is_whole, ranges_of

CHECKS: Mapping[str, Callable[[Any], None]] = {
    "dataset": check_dataset,
    "disturbance": check_disturbance,
    "attitude": check_attitude,
    "filter": check_filter,
    "adaptation": check_adaptation,
    "engine": check_engine,
    "metric": check_metric,
}
"""The check of each kind of plugin."""


def check_plugin(kind: str, plugin: Any) -> None:  # noqa: ANN401 - the plugin under test
    """Check that ``plugin`` is a frozen, hashable, documented dataclass, and all that its ``kind`` promises.

    Raises:
        PluginError: no such kind.
        AssertionError: something is not as it must be; a sentence says what.
    """
    if kind not in CHECKS:
        raise PluginError(unknown("kind of plugin", kind, CHECKS))
    for check in STAGES:
        check(plugin)
    require_methods(kind, plugin)
    CHECKS[kind](plugin)


def _check_class(plugin: Any) -> None:  # noqa: ANN401 - as above
    cls = type(plugin)
    subject = cls.__name__
    frozen = dataclasses.is_dataclass(cls) and cls.__dataclass_params__.frozen  # type: ignore[attr-defined]  # private to dataclasses
    require(frozen, f"{subject} is not a frozen dataclass; write @dataclass(frozen=True) above it.")
    doc = inspect.cleandoc(cls.__doc__ or "")
    summary = doc.split("\n", 1)[0]
    written = summary.endswith(".") and not summary.startswith(f"{subject}(")  # what dataclass puts there by itself
    require(written, f"{subject} has no docstring whose first line is one sentence; `jerkbench list` prints it.")
    family = "\n".join(inspect.cleandoc(c.__doc__ or "") for c in cls.__mro__ if dataclasses.is_dataclass(c))
    for f in dataclasses.fields(cls):
        require(f"{f.name}:" in family, f"{subject} does not document its parameter {f.name} under Attributes.")
    _check_ranges(cls)


def _check_ranges(cls: type) -> None:
    """Check that each range has sense, and its field's default inside."""
    defaults = {f.name: f.default for f in dataclasses.fields(cls)}
    for name, bounds in ranges_of(cls).items():
        subject = f"{cls.__name__}.{name}"
        require(not bounds.mistake(), f"The range of {subject} makes no sense: {bounds.mistake()}.")
        default = defaults[name]
        number = isinstance(default, int | float) and not isinstance(default, bool)
        require(number, f"{subject} has a range and the default {default!r}; a search needs a number to begin from.")
        inside = bounds.low <= default <= bounds.high  # type: ignore[operator]  # it is a number
        require(inside, f"The default of {subject} is {default}, outside of its range {bounds}.")
        whole = not is_whole(cls, name) or (bounds.low % 1 == 0 and bounds.high % 1 == 0)
        require(whole, f"{subject} holds whole numbers; the bounds of its range are {bounds.low} and {bounds.high}.")


def _check_value(plugin: Any) -> None:  # noqa: ANN401 - as above
    subject = type(plugin).__name__
    try:
        hash(plugin)
    except TypeError as error:
        raise AssertionError(f"{subject} is not hashable ({error}); a field that is a list must be a tuple.") from error
    try:
        unpickled = pickle.loads(pickle.dumps(plugin))  # noqa: S301 - made the line before
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise AssertionError(f"{subject} cannot be pickled ({error}), so no worker process can run it.") from error
    require(unpickled == plugin, f"{subject} is another after pickling; a worker process would run something else.")


STAGES: Sequence[Callable[[Any], None]] = (_check_class, _check_value)
"""The checks of a plugin of any kind, each for itself."""
