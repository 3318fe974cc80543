"""Atomic writing, files that only this user can write, reading of untrusted YAML, and templates."""

import os
import stat
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml
from platformdirs import user_cache_path

from jerkbench.errors import JerkbenchError, plain


def user_cache_folder() -> Path:
    """Return the folder of jerkbench in the user's cache folder, which depends on the operating system."""
    return user_cache_path("jerkbench", appauthor=False)


def cache_folder(kind: str) -> Path:
    """Return the folder for a ``kind`` of cached data in $JERKBENCH_CACHE, or otherwise in the user's cache folder."""
    folder = os.environ.get("JERKBENCH_CACHE")
    return (Path(folder).expanduser() if folder else user_cache_folder()) / kind


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Call ``write`` with a temporary path in the folder of ``path``, and then rename the file to ``path``.

    ``path`` is always the old file or the complete new file, even if the process stops while it writes.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    try:
        write(partial)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


# Files with machine code or pickles. Such a file is loaded only if no other user can have written the file.


class Distrusted(Exception):  # noqa: N818 - not an error, because the file is created again
    """A file is not loaded, because it is damaged or another user may have changed it. The message gives the reason."""


def write_trusted(path: Path, content: bytes) -> None:
    """Write ``content`` with a checksum to ``path`` atomically, with permissions for this user only.

    Raises:
        OSError: The file cannot be written.
    """

    def write(partial: Path) -> None:
        partial.touch(mode=0o600)
        partial.write_bytes(_checksum(content) + content)

    write_atomically(path, write)


def read_trusted(path: Path) -> memoryview | None:
    """Return the content that `write_trusted` has written to ``path``, or None if the file cannot be read.

    The permissions are read from the open file, so that the file cannot be replaced between the check and the reading.

    Raises:
        Distrusted: The file belongs to another user, other users may write to it, or its checksum is wrong.
    """
    try:
        with path.open("rb") as file:
            _require_private(os.fstat(file.fileno()))
            content = file.read()
    except OSError:
        return None
    payload = memoryview(content)[CHECKSUM_BYTES:]
    if _checksum(payload) != content[:CHECKSUM_BYTES]:
        raise Distrusted("the checksum of the file is wrong")
    return payload


CHECKSUM_BYTES = 4


def _checksum(content: bytes | memoryview) -> bytes:
    """Return a checksum that detects damage. File permissions, and not the checksum, prevent manipulation by others."""
    return zlib.crc32(content).to_bytes(CHECKSUM_BYTES)


def _require_private(file: os.stat_result) -> None:
    """Require that only this user or root can have written a file. Windows has no user ids and is not checked."""
    if not hasattr(os, "geteuid"):
        return
    if file.st_uid not in (os.geteuid(), 0):
        raise Distrusted(f"the file belongs to another user ({file.st_uid})")
    if file.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise Distrusted("other users may write to the file")


def forget_oldest(folder: Path, pattern: str, most_bytes: int) -> None:
    """Delete the oldest files of a cache until the total size is at most ``most_bytes``.

    The newest file is never deleted. Files that another process deletes at the same time are ignored.
    """
    files: list[tuple[Path, os.stat_result]] = []
    for path in folder.glob(pattern):
        with suppress(FileNotFoundError):
            files.append((path, path.stat()))
    files.sort(key=lambda entry: -entry[1].st_mtime_ns)
    size = 0
    for rank, (path, of_file) in enumerate(files):
        size += of_file.st_size
        if rank and size > most_bytes:
            path.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` to ``path`` atomically, as UTF-8. Control characters are escaped (`plain`)."""
    write_atomically(path, lambda partial: partial.write_text(plain(text), encoding="utf-8"))


def filled_template(
    path: Path, filters: Mapping[str, Callable[..., object]] = MappingProxyType({}), /, **values: object
) -> str:
    """Return the text of a Jinja template, filled with ``values``. A missing value raises an exception.

    The template must not be HTML, because values are not escaped.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)  # noqa: S701 - not HTML
    environment.filters |= filters
    return environment.from_string(path.read_text(encoding="utf-8")).render(values)


def filled(page: str, parts: Mapping[str, str]) -> str:
    """Replace the text between ``<!-- NAME -->`` and ``<!-- end -->`` on a page, for each name in ``parts``."""
    for name, text in parts.items():
        begin, end = f"<!-- {name} -->\n", "<!-- end -->"
        before, rest = page.split(begin)
        page = f"{before}{begin}{text}\n{end}{rest.split(end, 1)[1]}"
    return page


# Untrusted YAML. A few lines with aliases can expand to more values than fit into memory.


MAX_VALUES = 100_000
"""Maximum number of values in a file. An alias counts as all the values that it repeats."""

MAX_DEPTH = 100
"""Maximum depth of nested lists and mappings."""

MAX_INTERPOLATIONS = 20
"""Maximum number of interpolations (${...}). Interpolations repeat values and can be nested, as aliases."""

LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

TOO_DEEP = "exceeded maximum nesting depth"
"""Error message of newer versions of libyaml. These versions read ahead and detect the depth before `require_small`."""


def read_yaml(path: Path) -> Any:  # noqa: ANN401 - any YAML value
    """Read an untrusted YAML file.

    Raises:
        JerkbenchError: The file has too many values or interpolations, or is nested too deeply.
        OSError: The file cannot be read.
        ValueError: The file is not UTF-8.
        yaml.YAMLError: The file is not valid YAML.
    """
    text = path.read_text(encoding="utf-8")
    require_small(text, path)
    return yaml.safe_load(text)


def require_small(text: str, path: Path) -> None:
    """Require that a YAML text is not too large and not nested too deeply, without creating the values of the text.

    Raises:
        JerkbenchError: The text has too many values or interpolations, is nested too deeply, or has a recursive alias.
        yaml.YAMLError: The text is not valid YAML.
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
            raise JerkbenchError(f"{path} has more than {MAX_INTERPOLATIONS} interpolations, ${{...}}; give values.")
        if values > MAX_VALUES or len(open_since) > MAX_DEPTH:
            raise _too_large(path)


def _events(text: str, path: Path) -> Iterator[yaml.Event]:
    """Yield the parser events of a YAML text. If libyaml rejects the nesting depth, raise a `JerkbenchError`."""
    try:
        yield from yaml.parse(text, LOADER)
    except yaml.MarkedYAMLError as error:
        if error.problem == TOO_DEEP:
            raise _too_large(path) from error
        raise


def _too_large(path: Path) -> JerkbenchError:
    limits = f"more than {MAX_VALUES} values, or lists that are nested more than {MAX_DEPTH} deep"
    return JerkbenchError(f"{path} has {limits}. An alias (*NAME) counts as all the values that it repeats.")
