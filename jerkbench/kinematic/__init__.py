"""The kernel of the compiled engine: kinematic filters, one run or several side by side, in plain functions of arrays.

The kernel is written for numbers; for several runs numba is given vectors in their place. What lasts lies in one array
w, at the offsets of `layout`: the compiler then sees that no two parts overlap, and that every loop has a known length.
What does not last lies in scratch, of which the compiler makes registers. The state of n quantities on three axes is
x[3 a + i], a the quantity and i the axis. The covariance lies by pairs of axes, because F = A (x) I3 is the same
product for each pair.

    single_run, batch      Python: what is run, and what came out
    packs, models          runs and filters as arrays (arguments)
    compiled_loop          the machine code of the loop, from the disk
    loop                   the steps: predict, update_step, score, trajectory
    update_step            innovation, adaptation, gain, correction
    adapt                  the calls of an adaptation, in their order: `fade` (fading), `adapt_prior` (prior), `adapt`
                           (plugin_call), `adapt_gain` (own_gain); what they see is shown and taken in exchange
"""
