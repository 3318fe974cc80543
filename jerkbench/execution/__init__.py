"""The execution of a cell: shared inputs, runs side by side or alone, processes, progress."""
