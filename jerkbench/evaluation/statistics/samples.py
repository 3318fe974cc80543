"""Samples of many sizes, taken together: those of one size are the rows of one array."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Samples:
    """Many samples, one after the other.

    Attributes:
        values: (n,) of all samples.
        sizes: (k,) how many of them each sample has.
    """

    values: FloatArray
    sizes: IntArray

    @classmethod
    def of(cls, samples: Sequence[npt.ArrayLike]) -> "Samples":
        """Take (n_1,), (n_2,), ... values."""
        arrays = [np.asarray(values, dtype=np.float64) for values in samples]
        sizes = np.array([len(array) for array in arrays], dtype=np.int64)
        return cls(np.concatenate([np.empty(0), *arrays]), sizes)

    @cached_property
    def owner(self) -> IntArray:
        """(n,) the sample of each value."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    def count(self, which: BoolArray) -> IntArray:
        """Return (k,) for how many values of each sample ``which`` (n,) holds."""
        return np.bincount(self.owner[which], minlength=len(self.sizes))

    def only(self, which: BoolArray) -> "Samples":
        """Return the samples with those values for which ``which`` (n,) holds; some may be empty."""
        return Samples(self.values[which], self.count(which))

    def without_nan(self) -> "Samples":
        """Return the samples without what is no number."""
        return self.only(~np.isnan(self.values))

    def by_size(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield for each size the places (j,) of the samples that have it, and their values (j, size)."""
        starts = np.cumsum(self.sizes) - self.sizes
        for size in np.unique(self.sizes).tolist():
            places = np.flatnonzero(self.sizes == size)
            yield places, self.values[starts[places][:, None] + np.arange(size)]
