"""Tables, figures and page of a study. Here: the choice of figures, for which a command line needs no Matplotlib."""

from enum import StrEnum

from jerkbench.errors import PluginError, unknown


class Choice(StrEnum):
    """Whose runs are drawn.

    Attributes:
        FEW: those of the scenarios and methods that carry a finding.
        ALL: those of every scenario.
        NONE: there is no figure.
    """

    FEW = "few"
    ALL = "all"
    NONE = "none"


SWITCHES = {"true": Choice.ALL, "false": Choice.NONE}
"""What the option was before it had three values."""


def figures_choice(text: str) -> Choice:
    """Read ``few``, ``all`` or ``none``; ``true`` is all, ``false`` none.

    Raises:
        PluginError: it is another word.
    """
    word = text.strip().lower()
    if word in SWITCHES:
        return SWITCHES[word]
    if word not in list(Choice):
        raise PluginError(unknown("choice of figures", text, list(Choice)))
    return Choice(word)
