"""Random number generators (streams) for the sources of randomness, all derived from the seed of a run."""

import hashlib

import numpy as np


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return the random generator for ``seed`` and ``names``.

    Streams with different names are independent, so the numbers of one noise source do not depend on other noise
    sources.

    >>> stream(1, "gyro").normal() == stream(1, "gyro").normal()
    True
    >>> stream(1, "gyro").normal() == stream(1, "accelerometer").normal()
    False
    """
    digest = hashlib.blake2b("/".join(names).encode(), digest_size=16).digest()
    return np.random.default_rng(np.random.SeedSequence([seed, int.from_bytes(digest, "little")]))
