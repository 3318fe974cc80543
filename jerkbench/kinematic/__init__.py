"""The kernel of the compiled engine: kinematic filters, one run or several side by side, in plain functions of a run.

The kernel is written for numbers; of several runs each element is a vector, one number of each. What lasts lies in one
array, of which `arguments` says what is where: the compiler then sees that no two parts overlap, and that every loop
has a known length. What does not last lies in a `room`, of which the compiler makes registers. The state of n
quantities on three axes is x[3 a + i], a the quantity and i the axis.

    runs                   Python: what is run, and what came out
    packs                  runs and filters as arrays (arguments)
    loop                   the steps: predict, update, score; compiled, or from the disk
    predict, correction    the equations
    score                  errors against the reference, and their sums
    adapt                  the calls of an adaptation, in their order: `fade`, `adapt_prior`, `adapt` (plugin_call),
                           `adapt_gain`; what an own gain does is in correction
    adapt_lanes            the same of an adaptation that many runs ask at once, in vectors
    trajectory_score       the sums of a run that has a trajectory
    mixture, smoother      several filters mixed (imm), and the smoother (rts), over the same parts
"""
