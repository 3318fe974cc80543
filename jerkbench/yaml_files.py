"""YAML of anybody, measured before it is read: a few lines of aliases can stand for more than a machine can hold."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from jerkbench.errors import JerkbenchError

MOST_VALUES = 100_000
"""Values of a file, each alias counted with all that it repeats."""

DEEPEST = 100
"""Lists and mappings inside each other."""

MOST_INTERPOLATIONS = 20
"""References to other values (${...}): each repeats what it refers to, as an alias does, and may hold some itself."""

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

TOO_DEEP = "exceeded maximum nesting depth"
"""What newer versions of libyaml say of a file, as they read some way ahead of the values that they give."""


def read_yaml(path: Path) -> Any:  # noqa: ANN401 - whatever stands there
    """Read a file.

    Raises:
        JerkbenchError: it is too large.
        OSError: it cannot be read.
        ValueError: it is no UTF-8.
        yaml.YAMLError: it is no YAML.
    """
    text = path.read_text(encoding="utf-8")
    require_small(text, path)
    return yaml.safe_load(text)


def require_small(text: str, path: Path) -> None:
    """Refuse what stands for too many values, or is nested too deep, without making any of them.

    Raises:
        JerkbenchError: it does, or an alias stands for what it is a part of.
        yaml.YAMLError: it is no YAML.
    """
    values, interpolations = 0, 0
    sizes: dict[str | None, int] = {}
    open_since: list[tuple[str | None, int]] = []
    for event in _events(text, path):
        if isinstance(event, yaml.AliasEvent):
            values += sizes.get(event.anchor, MOST_VALUES + 1)
        elif isinstance(event, yaml.NodeEvent):
            open_since.append((event.anchor, values))
            values += 1
        if isinstance(event, (yaml.ScalarEvent, yaml.CollectionEndEvent)):
            anchor, before = open_since.pop()
            sizes[anchor] = values - before
        interpolations += event.value.count("${") if isinstance(event, yaml.ScalarEvent) else 0
        if interpolations > MOST_INTERPOLATIONS:
            raise JerkbenchError(f"{path} has more than {MOST_INTERPOLATIONS} interpolations (${{...}}); write values.")
        if values > MOST_VALUES or len(open_since) > DEEPEST:
            raise _too_large(path)


def _events(text: str, path: Path) -> Iterator[yaml.Event]:
    """The events of a text; where the library itself refuses its depth, our sentence."""
    try:
        yield from yaml.parse(text, LOADER)
    except yaml.MarkedYAMLError as error:
        if error.problem == TOO_DEEP:
            raise _too_large(path) from error
        raise


def _too_large(path: Path) -> JerkbenchError:
    return JerkbenchError(
        f"{path} stands for more than {MOST_VALUES} values, or has lists nested more than {DEEPEST} deep. An alias"
        " (*NAME) counts as all the values that it repeats. Make the file smaller."
    )
