"""Docstrings of plugins as Markdown: prose, equations as text blocks, and descriptions of parameters."""

import re
from typing import NamedTuple

SECTION = "Attributes:"
"""Start of the list of parameters, which is the last part of a docstring."""


class Docstring(NamedTuple):
    """The parts of a docstring.

    Attributes:
        body: prose and equations, as Markdown.
        parameters: description of each parameter.
    """

    body: str
    parameters: dict[str, str]


def parsed(text: str) -> Docstring:
    """Return the parts of a cleaned docstring."""
    body, _, attributes = text.partition(f"\n{SECTION}\n")
    return Docstring(as_markdown(body.strip()), _described(attributes))


def as_markdown(text: str) -> str:
    """Return the text with fenced literal blocks (after ``::``) and escaped Markdown characters."""
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
    """Return a line of text with escaped Markdown characters, except in code between backticks."""
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
