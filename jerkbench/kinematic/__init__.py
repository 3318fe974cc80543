"""The compiled engine for kinematic filters, which processes eight runs at the same time.

The kernels (the functions that numba compiles) are plain Python functions that follow the equations of the filters. In
compiled code, each array element is a vector with one number for each of the eight runs
(`jerkbench.compilation.vectors`). A single run uses the same compiled loops, with seven unused numbers in each vector.
The package contains these modules::

    runs                     starts the runs from Python and returns their results
    packs, arguments         runs and filters as arrays, and the types of these arrays
    rules                    adaptations as compiled functions that have the same signature
    loop                     the prediction, and the loop over the steps: prediction, adaptation, update, scoring
    update                   innovation, call of the adaptation, and the equations of the correction
    scoring                  errors against the reference, summed during a run
    mixture, smoother        the mixture of two filters (`imm`), and the smoother (`rts`)
"""
