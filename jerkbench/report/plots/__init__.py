"""Functions that draw Matplotlib figures. Each function returns one figure."""
