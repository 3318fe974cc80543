"""The Python API on one screen.

From names to rows, and to a table of many::

    from jerkbench import api

    rows = api.run(filter="jerk", adaptation="mtf", seeds=3)                            # a DataFrame
    study = api.sweep("results/mine", filter=["baseline", "jerk"], adaptation=["none", "mtf"])
    print(api.table(study, baseline="adaptation=none"))                                 # Markdown; HTML in a notebook
    api.report(study)

Or step by step, each with plain objects in and out::

    recording = api.disturb(api.load("field", seed=1), "gnss_outage", seed=1)           # Recording
    estimate = api.estimate(recording, filter={"name": "jerk", "accel_mps2": 0.2})      # Estimate
    values = api.evaluate(estimate, recording)                                          # {"position_rmse_m": ...}
    api.figure(recording, {"jerk": estimate}).savefig("errors.png")

A part of a combination is a name (of a plugin or a preset), {"name": ..., parameter: value}, or a plugin of your own;
what is left out is what `jerkbench run` takes.
"""

from jerkbench.api.combination import run
from jerkbench.api.steps import disturb, estimate, evaluate, figure, load
from jerkbench.api.studies import report, sweep, table
from jerkbench.jobs.names import Part

__all__ = ["Part", "disturb", "estimate", "evaluate", "figure", "load", "report", "run", "sweep", "table"]
