"""The random stream of a disturbance."""

import numpy as np

from jerkbench.random_streams import stream


def own_stream(seed: int, disturbance: str, label: str, *parts: str) -> np.random.Generator:
    """Return the stream of a disturbance; another ``label`` gives another one, for a second of the name in a list."""
    named = (label,) if label else ()
    return stream(seed, "disturbance", disturbance, *named, *parts)
