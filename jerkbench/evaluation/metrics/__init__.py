"""The metrics. Each metric computes columns of rows.csv from an estimate and its recording."""
