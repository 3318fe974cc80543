"""The checks of a plugin of any kind."""

import dataclasses
import inspect
import pickle
from collections.abc import Callable, Mapping
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
    _check_class(type(plugin))
    _check_value(plugin)
    require_methods(kind, plugin)
    CHECKS[kind](plugin)


def _check_class(cls: type) -> None:
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
