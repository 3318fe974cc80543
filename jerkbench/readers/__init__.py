"""Readers of files -> plain arrays, and the steps before a recording. No plugin, no parameter file."""
