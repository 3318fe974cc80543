"""Tables, figures and the HTML report of a study.

This module contains only the choice of figures, so that the command line can read it without importing Matplotlib.
"""

from enum import StrEnum

from jerkbench.errors import PluginError, unknown


class Choice(StrEnum):
    """The scenarios whose runs are drawn in figures.

    Attributes:
        FEW: draw only scenarios and methods with significant differences.
        ALL: draw all scenarios of the study.
        NONE: draw no figures.
    """

    FEW = "few"
    ALL = "all"
    NONE = "none"


SWITCHES = {"true": Choice.ALL, "false": Choice.NONE}
"""Former values of the option ``figures``, and the values that replace them."""


def figures_choice(text: str) -> Choice:
    """Parse ``few``, ``all`` or ``none``. The former values ``true`` and ``false`` mean ``all`` and ``none``.

    Raises:
        PluginError: the text is not one of these values.
    """
    name = text.strip().lower()
    if name in SWITCHES:
        return SWITCHES[name]
    if name not in list(Choice):
        raise PluginError(unknown("choice of figures", text, list(Choice)))
    return Choice(name)
