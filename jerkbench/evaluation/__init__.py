"""(Estimate, Recording) -> numbers: errors, outages, consistency, statistics."""
