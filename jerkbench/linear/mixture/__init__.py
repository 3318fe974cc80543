"""Several kinematic filters mixed at each update; `jerkbench.filters._mixture` has the equations.

runs          Python: what is run, and what came out
loop          the steps; mixing: means, covariances and probabilities
"""
