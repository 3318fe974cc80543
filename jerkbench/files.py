"""Files that are written as a whole or not at all, YAML of anybody, measured before it is read, and JUnit files."""

import os
import stat
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import yaml
from platformdirs import user_cache_path

from jerkbench.errors import JerkbenchError
from jerkbench.notices import plain


def user_cache_folder() -> Path:
    """Return this package's folder in the user's cache, wherever the operating system has it."""
    return user_cache_path("jerkbench", appauthor=False)


def cache_folder(kind: str) -> Path:
    """Return where one kind of things that can be made again is kept: in $JERKBENCH_CACHE, or in the user's cache."""
    own = os.environ.get("JERKBENCH_CACHE")
    return (Path(own).expanduser() if own else user_cache_folder()) / kind


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then put it in its place.

    A reader, or a run that is stopped at any moment, sees the old file or the new one, never a part.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    try:
        write(partial)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


# What is run, or unpickled, when it is loaded: believed only if this user alone can have written it.


class Distrusted(Exception):  # noqa: N818 - no error: it is made anew
    """Why a file is not loaded."""


def write_trusted(path: Path, content: bytes) -> None:
    """Keep ``content`` at ``path``, as a whole, so that nobody else may write it.

    Raises:
        OSError: nothing can be written there.
    """

    def write(partial: Path) -> None:
        partial.touch(mode=0o600)
        partial.write_bytes(_checksum(content) + content)

    write_atomically(path, write)


def read_trusted(path: Path) -> memoryview | None:
    """Return what `write_trusted` kept at ``path``, or None where there is nothing to read.

    The file that is checked is the one that is read, whoever puts another in its place.

    Raises:
        Distrusted: it belongs to somebody else, others may write to it, or it is not what was written.
    """
    try:
        with path.open("rb") as file:
            _require_own(os.fstat(file.fileno()))
            content = file.read()
    except OSError:  # there is none, or it cannot be read; whether it can be written shows later
        return None
    kept = memoryview(content)[CHECKSUM_BYTES:]
    if _checksum(kept) != content[:CHECKSUM_BYTES]:
        raise Distrusted("it is not what was written there")
    return kept


CHECKSUM_BYTES = 4


def _checksum(content: bytes | memoryview) -> bytes:
    """It tells damage. Who may write there could make any: that is what the owner is asked for."""
    return zlib.crc32(content).to_bytes(CHECKSUM_BYTES)


def _require_own(file: os.stat_result) -> None:
    """Check that only this user, or the system's, can have written it; where there are no such users, all is well."""
    if not hasattr(os, "geteuid"):
        return
    if file.st_uid not in (os.geteuid(), 0):
        raise Distrusted(f"it belongs to another user ({file.st_uid})")
    if file.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise Distrusted("others may write to it")


def exists(path: Path) -> bool:
    """Whether anything has that name, be it a link that leads nowhere."""
    return path.is_symlink() or path.exists()


def forget_oldest(folder: Path, pattern: str, most_bytes: int) -> None:
    """Delete files of a cache until the rest is not larger than ``most_bytes``: the longest unused first.

    The latest one stays, however large. A file that another process deletes meanwhile is gone as well.
    """
    files: list[tuple[Path, os.stat_result]] = []
    for path in folder.glob(pattern):
        with suppress(FileNotFoundError):
            files.append((path, path.stat()))
    files.sort(key=lambda entry: -entry[1].st_mtime_ns)
    size = 0
    for place, (path, of_file) in enumerate(files):
        size += of_file.st_size
        if place and size > most_bytes:
            path.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` to ``path`` atomically, as UTF-8; what would steer a terminal or end a line is written out."""
    write_atomically(path, lambda partial: partial.write_text(plain(text), encoding="utf-8"))


def filled_template(
    path: Path, filters: Mapping[str, Callable[..., object]] = MappingProxyType({}), /, **values: object
) -> str:
    """Return the template at ``path``, of a text that is no HTML, filled in; a value that is not given is an error."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)  # noqa: S701 - no HTML
    environment.filters |= filters
    return environment.from_string(path.read_text(encoding="utf-8")).render(values)


def filled(page: str, parts: Mapping[str, str]) -> str:
    """Return a page with each of its parts, which stand between ``<!-- NAME -->`` and ``<!-- end -->``, made anew."""
    for name, text in parts.items():
        begin, end = f"<!-- {name} -->\n", "<!-- end -->"
        before, rest = page.split(begin)
        page = f"{before}{begin}{text}\n{end}{rest.split(end, 1)[1]}"
    return page


# YAML of anybody: a few lines of aliases can stand for more than a machine can hold.


MAX_VALUES = 100_000
"""Values of a file, each alias counted with all that it repeats."""

DEEPEST = 100
"""Lists and mappings inside each other."""

MAX_INTERPOLATIONS = 20
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
            values += sizes.get(event.anchor, MAX_VALUES + 1)
        elif isinstance(event, yaml.NodeEvent):
            open_since.append((event.anchor, values))
            values += 1
        if isinstance(event, (yaml.ScalarEvent, yaml.CollectionEndEvent)):
            anchor, before = open_since.pop()
            sizes[anchor] = values - before
        interpolations += event.value.count("${") if isinstance(event, yaml.ScalarEvent) else 0
        if interpolations > MAX_INTERPOLATIONS:
            raise JerkbenchError(f"{path} has more than {MAX_INTERPOLATIONS} interpolations (${{...}}); write values.")
        if values > MAX_VALUES or len(open_since) > DEEPEST:
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
        f"{path} stands for more than {MAX_VALUES} values, or has lists nested more than {DEEPEST} deep. An alias"
        " (*NAME) counts as all the values that it repeats. Make the file smaller."
    )


# Results of checks in the JUnit format, which build servers read


class JunitCase(NamedTuple):
    """One check.

    Attributes:
        group: group of checks.
        name: name of the check.
        failures: messages. Empty if the check passed.
        notes: messages that are not failures.
    """

    group: str
    name: str
    failures: Sequence[str] = ()
    notes: Sequence[str] = ()


def junit(suite: str, cases: Sequence[JunitCase]) -> str:
    """Return the text of a JUnit file with one suite."""
    failed = sum(bool(case.failures) for case in cases)
    root = ET.Element("testsuite", name=suite, tests=str(len(cases)), failures=str(failed), errors="0")
    for case in cases:
        element = ET.SubElement(root, "testcase", classname=case.group, name=case.name)
        for message in case.failures:
            ET.SubElement(element, "failure", message=message).text = message
        if case.notes:
            ET.SubElement(element, "system-out").text = "\n".join(case.notes)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
