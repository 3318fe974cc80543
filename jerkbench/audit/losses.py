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
    found = picks(protocol, rows.tuned)
    return Cubes(
        _array(_with_losses(rows, tried, cost or protocol.lost_costs), methods, ["tuning", "seed"]),
        _array(found[found["tried"] == tried], methods, ["tuning"]),
    )


def defaults(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the log errors (M, D) of ``methods`` at their defaults."""
    return _array(_with_losses(rows, 1, rows.protocol.lost_costs), methods, ["seed"])


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


def _with_losses(rows: AuditRows, tried: int, cost: float) -> pd.DataFrame:
    own = rows.judged[rows.judged["tried"] == tried]
    level = own["seed"].map(rows.drives.set_index("seed")["level"]).to_numpy()
    error = own["log_error"].to_numpy(dtype=np.float64)
    return own.assign(loss=log_losses(np.exp(error), np.isnan(error), np.exp(level), cost))


def _array(table: pd.DataFrame, methods: Sequence[AuditMethod], axes: Sequence[str]) -> FloatArray:
    """The column ``loss`` of a table as an array: the methods, then the ``axes`` in the order of their values."""
    name = table["filter"].astype(str) + " + " + table["adaptation"].astype(str)
    names = [method.name for method in methods]
    known = table.assign(name=name)[name.isin(names)]
    wide = known.pivot_table(index=[*axes], columns="name", values="loss", aggfunc="first", dropna=False, observed=True)
    sizes = [known[axis].nunique() for axis in axes]
    return np.asarray(wide[names].to_numpy(dtype=np.float64).T.reshape(len(names), *sizes))
