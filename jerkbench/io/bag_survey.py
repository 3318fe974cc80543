"""Text that lists the topics of a bag, so that a user can assign topics to roles."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from jerkbench.io.bag import FIELDS, Bag


def survey(bag: Bag) -> Iterator[str]:
    """Yield a line for each topic, and more lines with the delay and the medians of the fields of supported topics.

    For a covariance, only the medians of the variances are printed.

    Raises:
        RecordingError: the messages of a topic are damaged.
    """
    for topic in bag.topics:
        counted = f"{topic.name} ({topic.msgtype}): {topic.count} messages"
        if topic.msgtype not in FIELDS or not topic.count:
            yield counted
            continue
        messages = bag.read({topic.name: tuple(FIELDS[topic.msgtype])})[topic.name]
        frames = " in ".join(name for name in (messages.child_frame_id, messages.frame_id) if name)
        duration_s = float(np.ptp(messages.bag_ns)) * 1e-9
        rate = f"{(topic.count - 1) / duration_s:.4g} Hz" if duration_s else "no rate"
        yield f"{counted}, {rate}, frame {frames or '-'}"
        low, middle, high = np.percentile((messages.bag_ns - messages.stamp_ns) * 1e-9, [0, 50, 100])
        yield f"    recorded {middle:.3f} s after its stamp ({low:.3f} to {high:.3f} s)"
        for name, values in dict(messages.values).items():
            damaged = int((~np.isfinite(values)).any(axis=1).sum())
            count = f"; NaN or infinite in {damaged} of {len(values)} messages" if damaged else ""
            shown = values[:, [0, 4, 8]] if values.shape[1] == 9 else values
            medians = ", ".join(f"{median:.8g}" for median in pd.DataFrame(shown).median())
            yield f"    {name.replace('_', ' ')} (median): {medians}{count}"
