"""The metrics: each gives columns of rows.csv from an estimate and its recording; one file for each kind."""
