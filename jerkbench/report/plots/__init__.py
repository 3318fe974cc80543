"""Functions that draw Matplotlib figures. Each of these functions returns one figure."""
