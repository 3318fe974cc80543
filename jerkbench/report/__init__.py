"""Tables, figures and the HTML report of a study.

This module defines only the option ``figures``, so that the command line can read the option without importing
Matplotlib.
"""

from enum import StrEnum

from jerkbench.errors import require_known


class Choice(StrEnum):
    """The values of the option ``figures``, which selects the scenarios whose runs are drawn.

    Attributes:
        FEW: draw only the scenarios with the largest differences.
        ALL: draw all scenarios of the study.
        NONE: draw no figures.
    """

    FEW = "few"
    ALL = "all"
    NONE = "none"


SWITCHES = {"true": Choice.ALL, "false": Choice.NONE}
"""Former values of the option ``figures``, and the values that replace them."""


def figures_choice(text: str) -> Choice:
    """Convert the text ``few``, ``all`` or ``none`` to a `Choice`.

    The old values ``true`` and ``false`` are still accepted, and mean ``all`` and ``none``.

    Raises:
        PluginError: the text is not a valid value of the option.
    """
    name = text.strip().lower()
    choice = SWITCHES.get(name, name)
    require_known("choice of figures", choice, list(Choice))
    return Choice(choice)
