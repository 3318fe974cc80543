"""Random streams: one for each source of randomness, all derived from the one seed of a run."""

import hashlib

import numpy as np


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return the generator that belongs to ``names`` under ``seed``.

    Streams with different names are independent, so that switching one source of noise on does not move another.

    >>> stream(1, "gyro").normal() == stream(1, "gyro").normal()
    True
    >>> stream(1, "gyro").normal() == stream(1, "accelerometer").normal()
    False
    """
    digest = hashlib.blake2b("/".join(names).encode(), digest_size=16).digest()
    return np.random.default_rng(np.random.SeedSequence([seed, int.from_bytes(digest, "little")]))
