"""From the rows of an audit to log errors by method, tuning and drive."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.audit.campaign import METHOD, picks
from jerkbench.audit.protocol import PUBLISHED, AuditMethod
from jerkbench.audit.stored import AuditRows
from jerkbench.evaluation.statistics.drives_and_tunings import Losses, log_losses


class Cubes(NamedTuple):
    """Log errors of some methods.

    Attributes:
        tuned: (M, R, D) as tuned, on the drives to judge on.
        on_tuning: (M, R) of what was found, on the drives to tune on.
    """

    tuned: FloatArray
    on_tuning: FloatArray


def cubes(rows: AuditRows, methods: Sequence[AuditMethod], tried: int = 0, cost: float = 0.0) -> Cubes:
    """Return the log errors of ``methods``, all of which have as many tunings and drives.

    Args:
        rows: of the audit.
        methods: in order.
        tried: how many settings a search has tried; default: as many as a method may.
        cost: of a lost run; default: that of the protocol. It changes what is judged, not what the search has found.
    """
    protocol, tried = rows.protocol, tried or rows.protocol.trials
    tunings, seeds = protocol.tunings_of(methods[0]), protocol.judges(methods[0])
    found = picks(protocol, rows.tuned)
    found = found[found["tried"] == tried]
    on_tuning = np.full((len(methods), len(tunings)), np.nan)
    on_tuning[_places(found, methods)] = found.loc[_known(found, methods), "loss"]
    return Cubes(_judged(rows, methods, tried, seeds, len(tunings), cost or protocol.lost_costs), on_tuning)


def defaults(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the log errors (M, D) of ``methods`` at their defaults."""
    protocol = rows.protocol
    return _judged(rows, methods, 1, protocol.judges(methods[0]), 1, protocol.lost_costs)[:, 0]


def losses_of(rows: AuditRows, cost: float = 0.0) -> Losses:
    """Return the log errors of all that are compared, with a ``cost`` of a lost run as in `cubes`."""
    protocol = rows.protocol
    methods, plains = (cubes(rows, own, 0, cost) for own in (protocol.methods, protocol.plains))
    wide = cubes(rows, protocol.plains, protocol.plain_trials, cost)
    published = np.array([protocol.adaptations[method.adaptation] in PUBLISHED for method in protocol.methods])
    model = np.array([protocol.filters.index(method.filter) for method in protocol.methods])
    of_tuning = methods.on_tuning, plains.on_tuning, wide.on_tuning
    return Losses(methods.tuned, plains.tuned, wide.tuned, *of_tuning, model, published, published)


def lost_shares(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the share of the runs of each of ``methods``, as tuned, that were lost."""
    own = rows.judged[rows.judged["tried"] == rows.protocol.trials]
    shares = own["log_error"].isna().groupby([own[name].astype(str) for name in METHOD]).mean()
    return np.asarray(shares.loc[list(methods)], dtype=np.float64)


def _judged(
    rows: AuditRows, methods: Sequence[AuditMethod], tried: int, seeds: range, tunings: int, cost: float
) -> FloatArray:
    own = rows.judged[rows.judged["tried"] == tried]
    own = own[_known(own, methods)]
    method, tuning = _places(own, methods)
    drive = own["seed"].to_numpy() - seeds[0]
    level = own["seed"].map(rows.drives.set_index("seed")["level"]).to_numpy()
    error = own["log_error"].to_numpy(dtype=np.float64)
    losses = np.full((len(methods), tunings, len(seeds)), np.nan)
    losses[method, tuning, drive] = log_losses(np.exp(error), np.isnan(error), np.exp(level), cost)
    return losses


def _known(table: pd.DataFrame, methods: Sequence[AuditMethod]) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    return np.asarray(_numbers(table, methods) >= 0)


def _places(table: pd.DataFrame, methods: Sequence[AuditMethod]) -> tuple["np.ndarray", "np.ndarray"]:
    """The places of the rows of ``methods``: the method's number and the tuning's."""
    numbers = _numbers(table, methods)
    return numbers[numbers >= 0], table["tuning"].to_numpy()[numbers >= 0].astype(int)


def _numbers(table: pd.DataFrame, methods: Sequence[AuditMethod]) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """(n,) the number of the method of each row; -1 of others."""
    names = table["filter"].astype(str) + " + " + table["adaptation"].astype(str)
    return pd.Index([method.name for method in methods]).get_indexer(pd.Index(names))
