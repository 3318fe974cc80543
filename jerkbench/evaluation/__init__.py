"""(Estimate, Recording) -> numbers: metrics, the columns of rows.csv, divergence, statistics."""
