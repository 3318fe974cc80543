"""The SQLite files of ROS 2: a table of messages."""

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

import numpy as np

from jerkbench.readers.ros.bulk.cutting import Cut, NotInBulk, as_bytes

AT_ONCE = 512  # more at once keep the collector of garbage busy


def cut_sqlite(path: Path, wanted: Collection[str]) -> Iterator[Cut]:
    """Yield the messages of the topics ``wanted``, some thousand at a time.

    Raises:
        NotInBulk: messages of one topic have different lengths.
        sqlite3.Error: the file is damaged.
    """
    with closing(sqlite3.connect(f"file:{quote(str(path.resolve()))}?immutable=1", uri=True)) as base:
        _check_whole(path, base)
        topics = {number: name for number, name in base.execute("SELECT id, name FROM topics") if name in wanted}
        places = ", ".join("?" * len(topics))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({places})"  # noqa: S608 - only "?"
        found = base.execute(query, tuple(topics))
        while some := found.fetchmany(AT_ONCE):
            for number in dict.fromkeys(row[0] for row in some):
                yield _cut([row for row in some if row[0] == number], number, topics[number])


def _check_whole(path: Path, base: sqlite3.Connection) -> None:
    """A table that lost its end, or a page, is read without a complaint: compare it with its index and the file's size.

    Source: the database file format, sqlite.org/fileformat2.html: size of a page and number of pages in the header.
    """
    with path.open("rb") as file:
        header = file.read(100)
    page = int.from_bytes(header[16:18], "big")
    pages = int.from_bytes(header[28:32], "big")
    by_index = base.execute("SELECT count(*) FROM messages").fetchone()
    by_table = base.execute("SELECT count(*) FROM messages NOT INDEXED").fetchone()
    if path.stat().st_size < pages * (65536 if page == 1 else page) or by_index != by_table:
        raise NotInBulk


def _cut(some: list[tuple[int, int, bytes]], number: int, topic: str) -> Cut:
    _, times, messages = zip(*some, strict=True)
    size, joined = len(messages[0]), b"".join(messages)
    if any(len(message) != size for message in messages) or not size:
        raise NotInBulk
    return Cut(topic, number, np.array(times, dtype=np.int64), as_bytes(joined).reshape(-1, size))
