"""Plain Python functions, compiled by numba and kept on disk, so that the next process compiles nothing."""
