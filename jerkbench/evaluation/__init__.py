"""Evaluation of runs: metrics (the columns of rows.csv), divergence, and statistics over seeds."""
