"""The page of an entry: one line, and a table of its scenarios."""

import numpy as np
import pandas as pd

from jerkbench.report.tables.writers import passive
from jerkbench.suite.campaign import ENTRY, GIVEN
from jerkbench.suite.protocol import SuiteProtocol
from jerkbench.suite.scores import EntryScore, entry_log_ratios

EXPLANATION = """\
Ratios of the position RMSE to the plain filter ({plain}), tuned with the same budget; below 1 is better. What is tuned
on one half of the faults is scored on the other, on seeds that no search has seen. A lost run counts a hundred times
the plain filter's level.
"""


def entry_page(name: str, score: EntryScore, rows: pd.DataFrame, protocol: SuiteProtocol) -> str:
    """Return the page as Markdown."""
    tuned_on = set(rows.loc[rows["method"] == ENTRY, "tuned_on"])
    plain = EXPLANATION.format(plain=" + ".join(protocol.plain.values()))
    return "\n".join(
        [passive(entry_line(name, score, protocol, tuned=tuned_on != {GIVEN})), "", plain, *_table(rows, protocol)]
    )


def entry_line(name: str, score: EntryScore, protocol: SuiteProtocol, *, tuned: bool) -> str:
    """Return what came out, in one line."""
    how = f"tuned, {protocol.trials} settings" if tuned else "not tuned"
    return (
        f"{name} on {protocol.name}: {score.ratio:.3f} of the tuned plain filter [{score.low:.3f}, {score.high:.3f}],"
        f" {score.verdict}; worst {score.worst} {score.worst_ratio:.2f}; nothing wrong {score.nominal:.3f};"
        f" lost {100 * score.lost:.1f} %; {how}."
    )


def _table(rows: pd.DataFrame, protocol: SuiteProtocol) -> list[str]:
    ratios = np.exp(entry_log_ratios(rows, protocol).mean(axis=1))
    lost = rows[rows["method"] == ENTRY].groupby("scenario")["status"].agg(lambda status: (status != "ok").sum())
    lines = [
        f"| {scenario.name} | {ratio:.3f} | {lost[number]} |"
        for number, (scenario, ratio) in enumerate(zip(protocol.scenarios, ratios, strict=True))
    ]
    return ["| scenario | ratio | lost runs |", "|---|---|---|", *lines, ""]
