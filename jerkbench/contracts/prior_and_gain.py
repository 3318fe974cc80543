"""Optional parts of an adaptation that changes more than R: the prior covariance, the gain."""

from typing import Protocol, runtime_checkable

from jerkbench.arrays import FloatArray, IntArray


@runtime_checkable
class Fading(Protocol):
    """An adaptation that fades P as well, all of it by one number; each element by its own: `AdaptingPrior`."""

    def fade(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> float:
        """Return the factor on the prior covariance; it is asked first, and `adapt` then sees the faded HPHt.

        Arguments are those of `Adaptation.adapt`.
        """
        ...


@runtime_checkable
class AdaptingPrior(Protocol):
    """An adaptation that changes the prior covariance, each element for itself: P and Q, or prior and R at once."""

    def adapt_prior(
        self,
        x: FloatArray,
        P: FloatArray,
        F: FloatArray,
        Q: FloatArray,
        innovation: FloatArray,
        R: FloatArray,
        rows: IntArray,
        memory: FloatArray,
    ) -> FloatArray:
        """Return the prior covariance to use.

        It is asked after `Fading.fade` and before `Adaptation.adapt`, which then sees the changed H P H'; what it finds
        out about R it leaves in the memory for `adapt`. F and Q are those of all steps since the update before, P+ its
        posterior (at the first update the start): P = F P+ F' + Q unless P was faded.

        Args:
            x: (n,) prior state. Position and velocity come first: H x is ``x[rows]``, H P H' ``P[rows][:, rows]``.
            P: (n, n) its covariance.
            F: (n, n) transition since the update before.
            Q: (n, n) process noise since then.
            innovation: as in `adapt`, like the rest.
            R: likewise.
            rows: likewise.
            memory: likewise; its length may depend on n (`RememberingStates`).

        Returns:
            (n, n), symmetric and positive definite.
        """
        ...


@runtime_checkable
class AdaptingGain(Protocol):
    """An adaptation with a gain K of its own: x = x + K y, P = (I - K H) P (I - K H)' + K R K'."""

    def adapt_gain(
        self, x: FloatArray, P: FloatArray, innovation: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return K (n, m), in place of P H' S^-1; it is asked last.

        Arguments are those of `AdaptingPrior.adapt_prior`, P and R as adapted, without the rows that were dropped.
        """
        ...
