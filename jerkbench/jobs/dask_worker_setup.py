"""The setup of a Dask worker that a sweep has started: Ctrl-C is for the sweep, which ends its workers."""

import signal


def dask_setup(worker: object) -> None:
    """Ignore Ctrl-C; Dask calls this in each worker as it starts."""
    del worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)
