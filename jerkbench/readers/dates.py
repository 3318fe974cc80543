"""A date and a time of day, as text, to nanoseconds."""

import re

import numpy as np

DATE = re.compile(r"(19|20|21)\d\d-\d\d-\d\d", re.ASCII)
"""Years that fit into 64 bits of nanoseconds."""

TIME = re.compile(r"\d\d:\d\d:\d\d(\.\d{1,12})?", re.ASCII)


def calendar_ns(date: str, time: str) -> int | None:
    """Return nanoseconds of the calendar since 1970 of ``2011-09-26``, ``13:02:25.594``; None where it is none.

    >>> calendar_ns("1970-01-02", "00:00:01.5")
    86401500000000
    """
    if not (DATE.fullmatch(date) and TIME.fullmatch(time)):
        return None
    try:
        return int(np.datetime64(f"{date}T{time}", "ns").astype(np.int64))
    except ValueError:  # the 31st of April
        return None
