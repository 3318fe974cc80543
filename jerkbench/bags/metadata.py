"""The metadata of a recording that no ROS message holds: the topic that our own writer adds, as JSON."""

import json
from dataclasses import dataclass
from typing import Any, Self

from jerkbench.readers.ros.bag import Bag
from jerkbench.readers.ros.errors import BagError

METADATA_TOPIC = "/jerkbench/about"
STRING = "std_msgs/msg/String"


@dataclass(frozen=True)
class Metadata:
    """The metadata that `jerkbench data convert` writes beside the measurements.

    Attributes:
        name: of the recording.
        start_ns: time 0, nanoseconds since 1970.
        static_start_s: how long it stands still.
        origin: latitude [deg], longitude [deg], height [m]; empty where unknown.
        reference_source: where the reference comes from.
        reference_independent: whether it shares nothing with the measurements.
        outages_s: intervals without aiding.
        topics: role -> topic.
        velocity_frame: frame of the velocity.
        heading_source: what measured the headings.
        covariance_order: of the fixes: neu or enu.
    """

    name: str
    start_ns: int
    static_start_s: float
    origin: tuple[float, ...]
    reference_source: str
    reference_independent: bool
    outages_s: tuple[tuple[float, float], ...]
    topics: dict[str, str]
    velocity_frame: str
    heading_source: str
    covariance_order: str

    @classmethod
    def from_plain(cls, values: dict[str, Any]) -> Self:
        """Return it from what JSON makes of it.

        Raises:
            ValueError, TypeError, KeyError, AttributeError: something is missing or of another type.
        """
        topics = {str(role): str(topic) for role, topic in values["topics"].items()}
        origin = tuple(float(value) for value in values["origin"])
        outages_s = tuple((float(begin), float(end)) for begin, end in values["outages_s"])
        return cls(**{**values, "topics": topics, "origin": origin, "outages_s": outages_s})

    def to_json(self) -> str:
        """Return the content of the message."""
        return json.dumps(vars(self), sort_keys=True)


def read_metadata(bag: Bag) -> Metadata | None:
    """Return what the bag's own topic says, or None where there is none.

    Raises:
        BagError: the topic is there and damaged.
    """
    if not any(topic.name == METADATA_TOPIC and topic.msgtype == STRING and topic.count for topic in bag.topics):
        return None
    text = bag.text(METADATA_TOPIC)
    try:
        return Metadata.from_plain(json.loads(text))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise BagError(
            f"{bag.path}, topic {METADATA_TOPIC} is damaged ({type(error).__name__}); convert the recording once more."
        ) from error
