"""Data sets, which read or simulate recordings. Each module contains the data sets of one source."""
