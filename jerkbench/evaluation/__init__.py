"""(Estimate, Recording) -> numbers: divergence, the columns of rows.csv (one file a metric), statistics."""
