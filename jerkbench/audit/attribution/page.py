"""The page of an attribution in words, each number from its shares."""

from collections.abc import Sequence
from math import factorial

from jerkbench.audit.attribution.factors import FACTORS, methods_of
from jerkbench.audit.attribution.shares import Share, share_table
from jerkbench.audit.protocol import AuditProtocol

TEXT = """\
## What the gain is made of

{naive}, whose sigma_a is the accelerometer's own noise and whose tilt is that of the gyro alone, against {whole},
tuned, with the tilt filter: {sentence}

{table}
Shapley's shares: what a factor adds, mean over the {orders} orders in which five can be added, so that no order is
preferred; they multiply to the whole. *added first*: to the naive filter alone; *added last*: to all the others. Where
these differ, factors act together. *tuning of Q* is of the filter's parameters, *tuning of R* of `r_scale` and of the
adaptation's own. Each corner is tuned by itself with {trials} settings on one half of the faults and scored on the
other, {seeds} seeds a scenario; a lost run counts a hundredfold error. Intervals are over families and seeds. Command
`jerkbench audit --attribution`, protocol `{digest}`.

![Waterfall from the naive to the tuned filter](waterfall.png)

By family of faults each factor multiplies the RMSE by:

{families}"""


def attribution_page(shares: Sequence[Share], families: str, protocol: AuditProtocol) -> str:
    """Return the section as Markdown.

    Args:
        shares: of each factor, and the whole.
        families: a table by family.
        protocol: of the study.
    """
    naive, *_, whole = methods_of(protocol).values()
    return TEXT.format(
        naive=naive.name,
        whole=whole.name,
        sentence=sentence(shares),
        table=share_table(shares),
        families=families,
        orders=factorial(len(FACTORS)),
        trials=protocol.trials,
        seeds=protocol.test_seeds,
        digest=protocol.digest,
    )


def sentence(shares: Sequence[Share]) -> str:
    """Return the shares in one sentence."""
    *factors, whole = shares
    parts = ", ".join(f"{row.factor} {100 * row.share:.0f} %" for row in factors)
    interval = f"95 % {whole.ratio.low:.3f} to {whole.ratio.high:.3f}"
    return f"the RMSE is multiplied by {whole.ratio.ratio:.3f} ({interval}). Of the logarithm of that gain: {parts}."
