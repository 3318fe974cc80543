"""A selection of a stream's rows."""

import dataclasses
from typing import Any, TypeVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.recording import Heading, Position, Reference, Velocity

Stream = TypeVar("Stream", Position, Velocity, Heading, Reference)


def rows_of(stream: Stream, keep: BoolArray, **changes: Any) -> Stream:  # noqa: ANN401 - fields of the stream
    """Return ``stream`` with the rows where ``keep`` is True, and with the fields ``changes`` replaced."""
    values = {f.name: getattr(stream, f.name) for f in dataclasses.fields(stream)}
    arrays = {name: value[keep] for name, value in values.items() if isinstance(value, np.ndarray)}
    return dataclasses.replace(stream, **(arrays | changes))


def nanoseconds(t_s: FloatArray) -> "np.ndarray[Any, np.dtype[np.int64]]":
    """Whole nanoseconds, so that equal stamps are equal."""
    return np.round(t_s * 1e9).astype(np.int64)
