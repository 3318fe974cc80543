"""Confidence intervals, one file for each kind of number that is given one.

    errors_over_seeds      errors of a cell: the geometric mean (`student`, of few seeds `skewed`), or the median where
                           runs were lost
    signed_over_seeds      metrics with a sign or an expected value: the arithmetic mean; of few seeds `bootstrap`
    correlated_errors      the RMSE of a recording without seeds, from errors that follow each other
    median, share          what holds whatever the distribution is

Which of them a cell's metric gets is chosen in `jerkbench/report/tables/cell_columns.py`.
"""
