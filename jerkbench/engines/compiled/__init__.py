"""The kernels of the compiled engine: plain functions over arrays, each of which also runs without numba.

All that a run works on lies in one array w, at the offsets of `sizes`: the compiler then sees that no two parts
overlap, and that every loop has a known length. The state of n quantities on three axes is x[3 a + i], a the quantity
and i the axis. While predicting, the covariance lies in blocks of 3 x 3, w[B + 9 (n a + b) + 3 i + j], because
F = A (x) I3 mixes whole blocks; an update takes it as a square, w[P + S s + t].
"""
