"""Compilation of plain Python functions with numba, and the cache of the compiled code on disk."""
