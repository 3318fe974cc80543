"""Between the two layouts of the covariance: blocks of 3 x 3, and a square."""

from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled.sizes import B, N, P, S


def blocks_to_square(w: FloatArray) -> None:
    """Write the covariance in blocks into the square."""
    for a in range(N):
        for i in range(3):
            for b in range(N):
                for j in range(3):
                    w[P + S * (3 * a + i) + 3 * b + j] = w[B + 9 * (N * a + b) + 3 * i + j]


def square_to_blocks(w: FloatArray) -> None:
    """Write the square into the blocks."""
    for a in range(N):
        for b in range(N):
            for i in range(3):
                for j in range(3):
                    w[B + 9 * (N * a + b) + 3 * i + j] = w[P + S * (3 * a + i) + 3 * b + j]


def store_measured(w: FloatArray, covariance: FloatArray, k: int) -> None:
    """Write position and velocity of the covariance in blocks into row ``k`` of ``covariance`` (k, 36)."""
    for a in range(2):
        for i in range(3):
            for b in range(2):
                for j in range(3):
                    covariance[k, 18 * a + 6 * i + 3 * b + j] = w[B + 9 * (N * a + b) + 3 * i + j]
