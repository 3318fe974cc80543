"""The sweep over many cells."""
