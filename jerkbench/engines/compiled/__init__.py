"""The kernels of the compiled engine: plain functions over arrays, compiled once for several runs and once for one.

All that a run works on lies in one array w, at the offsets of `places`: the compiler then sees that no two parts
overlap, and that every loop has a known length. The state of n quantities on three axes is x[3 a + i], a the quantity
and i the axis. Between updates the covariance lies by pairs of axes, because F = A (x) I3 is the same product for each
pair; an update takes it as a square.
"""
