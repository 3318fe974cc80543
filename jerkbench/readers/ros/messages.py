"""The container of one topic's messages, as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Messages:
    """All messages of a topic, in the order in which they were recorded.

    Attributes:
        topic: its name.
        msgtype: its type, as ROS 2 writes it: sensor_msgs/msg/Imu.
        frame_id: of the first message; empty where there is none.
        child_frame_id: the same.
        bag_ns: (n,) when each was recorded, by the recording computer's clock.
        stamp_ns: (n,) stamps of the headers, nanoseconds since 1970.
        values: the fields by name, (n, k) each; `jerkbench.readers.ros.layouts.LAYOUTS` has the names.
    """

    topic: str
    msgtype: str
    frame_id: str
    child_frame_id: str
    bag_ns: IntArray
    stamp_ns: IntArray
    values: Mapping[str, FloatArray]

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.bag_ns)

    def __getitem__(self, name: str) -> FloatArray:
        """Return the field ``name``."""
        return self.values[name]

    def rows(self, rows: BoolArray | IntArray, **changed: FloatArray) -> "Messages":
        """Return only ``rows``, with the fields of ``changed`` (of all rows, or of these) put in before."""
        values = {name: changed.get(name, value)[rows] for name, value in self.values.items()}
        return self._with(self.bag_ns[rows], self.stamp_ns[rows], values)

    def stamped(self, stamp_ns: IntArray) -> "Messages":
        """Return the same messages with other stamps."""
        return self._with(self.bag_ns, stamp_ns, self.values)

    def with_values(self, **changed: FloatArray) -> "Messages":
        """Return the same messages with other, or more, fields."""
        return self._with(self.bag_ns, self.stamp_ns, {**self.values, **changed})

    def _with(self, bag_ns: IntArray, stamp_ns: IntArray, values: Mapping[str, FloatArray]) -> "Messages":
        return Messages(self.topic, self.msgtype, self.frame_id, self.child_frame_id, bag_ns, stamp_ns, values)

    def rate_hz(self) -> float:
        """Mean rate of the recording; 0 of fewer than two messages."""
        duration_ns = int(np.ptp(self.bag_ns)) if len(self) > 1 else 0
        return 1e9 * (len(self) - 1) / duration_ns if duration_ns > 0 else 0.0
