"""A source -> Recording; one file a source."""
