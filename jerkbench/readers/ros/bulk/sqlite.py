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
        topics = {number: name for number, name in base.execute("SELECT id, name FROM topics") if name in wanted}
        places = ", ".join("?" * len(topics))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({places})"  # noqa: S608 - only "?"
        found = base.execute(query, tuple(topics))
        while some := found.fetchmany(AT_ONCE):
            for number in dict.fromkeys(row[0] for row in some):
                yield _cut([row for row in some if row[0] == number], number, topics[number])


def _cut(some: list[tuple[int, int, bytes]], number: int, topic: str) -> Cut:
    _, times, messages = zip(*some, strict=True)
    size, joined = len(messages[0]), b"".join(messages)
    if any(len(message) != size for message in messages) or not size:
        raise NotInBulk
    return Cut(topic, number, np.array(times, dtype=np.int64), as_bytes(joined).reshape(-1, size))
