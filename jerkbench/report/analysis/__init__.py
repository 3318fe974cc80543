"""Rows of runs -> comparisons, verdicts and findings."""
