"""Several runs side by side: the kernels of the engine, with vectors in the place of numbers."""
