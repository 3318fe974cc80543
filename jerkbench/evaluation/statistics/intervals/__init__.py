"""Confidence intervals, by the kind of number that is given one; beside them the ways in which they are computed.

    errors_over_seeds      errors of a cell: from six seeds on the `median`, with the geometric mean of the runs that
                           went well beside it; of fewer seeds that mean, with the interval of `few_seeds`
    signed_over_seeds      metrics with a sign or an expected value: the arithmetic mean; of few seeds `bootstrap`
    correlated_errors      the RMSE of a recording without seeds, from errors that follow each other
    share                  how many runs were lost, whatever the distribution is

Which of them a cell's metric gets is chosen in `jerkbench/report/tables/grid.py`. The interval of a comparison
of two methods is that of their log ratios: `jerkbench/evaluation/statistics/judgement.py`.
"""
