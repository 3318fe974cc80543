"""The kernels of the compiled engine: plain functions over arrays, compiled once for several runs and once for one.

What lasts lies in one array w, at the offsets of `places`: the compiler then sees that no two parts overlap, and that
every loop has a known length. What does not last lies in scratch, of which the compiler makes registers. The state of n
quantities on three axes is x[3 a + i], a the quantity and i the axis. The covariance lies by pairs of axes, because
F = A (x) I3 is the same product for each pair; an update of one run takes it as a square, one of several runs takes its
elements from there.
"""
