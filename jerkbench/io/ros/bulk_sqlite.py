"""The SQLite files of ROS 2: a table of messages."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import closing
from itertools import islice
from pathlib import Path
from urllib.parse import quote

import apsw
import numpy as np

from jerkbench.io.ros.cutting import Cut, NotInBulk, as_bytes

AT_ONCE = 512  # more at once keep the collector of garbage busy


def cut_sqlite(path: Path, wanted: Collection[str]) -> Iterator[Cut]:
    """Yield the messages of the topics ``wanted``, some hundred at a time.

    Raises:
        NotInBulk: messages of one topic have different lengths, or the table has lost some.
        apsw.Error: the file is damaged.
    """
    _check_length(path)
    place, flags = f"file:{quote(str(path.resolve()))}?immutable=1", apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
    with closing(apsw.Connection(place, flags=flags)) as base:
        topics = {number: name for number, name in base.execute("SELECT id, name FROM topics") if name in wanted}
        places, read = ", ".join("?" * len(topics)), 0
        data = f"CASE WHEN topic_id IN ({places}) THEN data END"  # the others are only counted
        cursor = base.execute(f"SELECT topic_id, timestamp, {data} FROM messages", tuple(topics))  # noqa: S608 - only "?"
        while batch := list(islice(cursor, AT_ONCE)):
            read += len(batch)
            for number in topics.keys() & {row[0] for row in batch}:
                yield _cut([row for row in batch if row[0] == number], number, topics[number])
        if base.execute("SELECT count(*) FROM messages").fetchall() != [(read,)]:  # its index knows how many there were
            raise NotInBulk


def _check_length(path: Path) -> None:
    """A file that lost its end may be read without a complaint.

    Source: the database file format, sqlite.org/fileformat2.html: size of a page and number of pages in the header.
    """
    with path.open("rb") as file:
        header = file.read(100)
    page = int.from_bytes(header[16:18], "big")
    pages = int.from_bytes(header[28:32], "big")
    if path.stat().st_size < pages * (65536 if page == 1 else page):
        raise NotInBulk


def _cut(batch: Sequence[tuple[int, int, bytes]], number: int, topic: str) -> Cut:
    _, times, messages = zip(*batch, strict=True)
    sizes = set(map(len, messages))
    if len(sizes) > 1 or 0 in sizes:
        raise NotInBulk
    return Cut(topic, number, np.array(times, dtype=np.int64), as_bytes(b"".join(messages)).reshape(len(batch), -1))
