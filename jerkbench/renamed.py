"""Names of plugins and presets that have changed, understood for one version more; and words that are no longer."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

from jerkbench.errors import JerkbenchError

RENAMED: Mapping[str, Mapping[str, str]] = {
    "dataset": {
        "field_v1": "field_white",
        "field_v1_combined": "field_white_combined",
        "field_v1_headland": "field_white_headland",
        "field_v1_ruts": "field_white_ruts",
        "field_v1_vibration": "field_white_vibration",
    },
    "disturbance": {"bias": "imu_bias"},
    "filter": {"baseline_naive": "baseline_untuned"},
    "noise": {"naive": "untuned", "own": "default"},
}
"""For each kind the old names, and what each of them is called now."""


def new_name(kind: str, name: str) -> str:
    """Return what a plugin or preset is called now; a name that has not changed as it is."""
    return RENAMED.get(kind, {}).get(name, name)


def new_label(kind: str, label: str) -> str:
    """Return the label of a stored row with the names of today; its parameters stay.

    >>> new_label("disturbance", "bias(accel_mps2=0.1)+gnss_outage")
    'imu_bias(accel_mps2=0.1)+gnss_outage'
    """
    if kind not in RENAMED:
        return label
    return re.sub(r"(\([^()]*\))|\w+", lambda match: match[1] or new_name(kind, match[0]), label)


def new_word(word: str) -> str:
    """Return a word of a command line with the names of today.

    >>> new_word("disturbance=none,[bias,gnss_outage]"), new_word("disturbance.bias.accel_mps2=0.1")
    ('disturbance=none,[imu_bias,gnss_outage]', 'disturbance.imu_bias.accel_mps2=0.1')
    """
    key, equals, value = word.partition("=")
    group = key.lstrip("+~").partition("@")[0]
    if group in RENAMED:
        return f"{key}{equals}{new_label(group, value)}"
    kind, *rest = key.split(".")
    if kind in RENAMED and len(rest) > 1:
        return ".".join([kind, new_name(kind, rest[0]), *rest[1:]]) + equals + value
    return word


def renamed_notice(word: str) -> str:
    """Return the sentence on the old names in a word, or an empty string."""
    if (today := new_word(word)) == word:
        return ""
    return f"{word} is now {today}; the old name will be removed in the next version."


# Words that earlier versions understood: whoever types one hears what to do instead.


@cache
def removed() -> Mapping[str, str]:
    """Return what was typed, alone or with the word behind it, as a regular expression, and what to do instead."""
    known = tomllib.loads(Path(__file__).with_name("removed.toml").read_text(encoding="utf-8"))["removed"]
    return {own["typed"]: own["say"] for own in known}


def refuse_removed(words: Sequence[str]) -> None:
    """Refuse words of a command line, or options of a configuration, that are no longer understood.

    Raises:
        JerkbenchError: there is one; says what to do instead.
    """
    for word in (*words, *map(" ".join, pairwise(words))):
        for pattern, sentence in removed().items():
            if re.fullmatch(pattern, word, flags=re.DOTALL):
                raise JerkbenchError(sentence)
