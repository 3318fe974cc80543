"""Stands in the place of a `fade` that a plugin does not have."""

from dataclasses import dataclass

from jerkbench.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class NoFade:
    """Leaves the prior covariance as it is."""

    def fade(
        self,
        innovation: FloatArray,  # noqa: ARG002 - the contract names all its arguments
        HPHt: FloatArray,  # noqa: ARG002 - as above
        R: FloatArray,  # noqa: ARG002 - as above
        rows: IntArray,  # noqa: ARG002 - as above
        memory: FloatArray,  # noqa: ARG002 - as above
    ) -> float:
        """Return 1."""
        return 1.0
