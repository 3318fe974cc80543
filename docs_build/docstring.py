"""Docstrings of plugins as Markdown: prose, equations as they stand, and the words on each parameter."""

import re
from typing import NamedTuple

SECTION = "Attributes:"
"""Begins the list of parameters, which ends the docstring."""


class Docstring(NamedTuple):
    """A docstring in parts.

    Attributes:
        body: prose and equations, as Markdown.
        parameters: what is said about each parameter.
    """

    body: str
    parameters: dict[str, str]


def parsed(text: str) -> Docstring:
    """Return the parts of a cleaned docstring."""
    body, _, attributes = text.partition(f"\n{SECTION}\n")
    return Docstring(as_markdown(body.strip()), _described(attributes))


def as_markdown(text: str) -> str:
    """Return prose with its literal blocks (after ``::``) fenced, and the signs of Markdown escaped."""
    lines: list[str] = []
    literal = False
    for line in text.splitlines():
        if literal and line and not line.startswith(" "):
            lines = [*_without_blank_end(lines), "```", ""]
            literal = False
        if literal:
            lines.append(line.removeprefix("    "))
        elif line.endswith("::"):
            lines += [prose(line[:-1]), "", "```text"]
            literal = True
        else:
            lines.append(prose(line))
    return "\n".join([*_without_blank_end(lines), "```"] if literal else lines).replace("```text\n\n", "```text\n")


def prose(line: str) -> str:
    """Return a line of text with the signs of Markdown escaped, but for code in backticks."""
    parts = re.split(r"(``[^`]+``|`[^`]+`)", line)
    return "".join(part if part.startswith("`") else _escaped(part) for part in parts)


def _escaped(text: str) -> str:
    return re.sub(r"(?<!^)([*_|\[\]])", r"\\\1", text.replace("&", "&amp;").replace("<", "&lt;"))


def _described(attributes: str) -> dict[str, str]:
    described: dict[str, str] = {}
    name = ""
    for line in attributes.splitlines():
        if start := re.match(r"    (\w+): (.*)", line):
            name, described[start[1]] = start[1], start[2]
        elif name and line.strip():
            described[name] += f" {line.strip()}"
    return described


def _without_blank_end(lines: list[str]) -> list[str]:
    while lines and not lines[-1].strip():
        lines = lines[:-1]
    return lines
