"""The compiled engine for kinematic filters, which processes eight runs at the same time.

The kernels (the functions that numba compiles) are plain Python functions that follow the equations of the filters. In
compiled code, each array element is a vector with one number for each of the eight runs
(`jerkbench.compilation.vectors`). A single run uses the same compiled loops, with seven unused numbers in each vector.
The package contains these modules::

    runs                     packs of runs as arrays, the calls of the compiled loop, and the results
    arguments                the types of the arrays
    rules                    adaptations as compiled functions that have the same signature
    loop                     the loop over the steps: prediction, adaptation, update, and sums of the errors
    update                   innovation, call of the adaptation, and the equations of the correction
    mixture, smoother        the mixture of two filters (`imm`), and the smoother (`rts`)
"""
