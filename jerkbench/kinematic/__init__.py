"""The kernel of kinematic filters: plain functions over arrays, compiled for one run and for several side by side.

The kernel is written for numbers; for several runs numba is given vectors in their place. What lasts lies in one array
w, at the offsets of `layout`: the compiler then sees that no two parts overlap, and that every loop has a known length.
What does not last lies in scratch, of which the compiler makes registers. The state of n quantities on three axes is
x[3 a + i], a the quantity and i the axis. The covariance lies by pairs of axes, because F = A (x) I3 is the same
product for each pair.

    single_run, batch      Python: what is run, and what came out
    packs, models          runs and filters as arrays (arguments)
    loop                   the steps: predict, measure (innovation, adapt, update), score, trajectory
    plugin_call            the adaptation, compiled: its `adapt`; `fading` its `fade`, `prior` its `adapt_prior`,
                           `own_gain` its `adapt_gain`
"""
