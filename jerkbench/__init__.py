"""jerkbench: which navigation filter is better, by how much, on which recordings, and why."""
