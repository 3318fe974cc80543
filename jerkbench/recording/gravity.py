"""The gravity of every model."""

GRAVITY_MPS2 = 9.81
"""Magnitude of gravity that the filters, the simulator and the gravity compensation use."""
