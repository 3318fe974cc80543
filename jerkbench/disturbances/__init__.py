"""Disturbances, which change a simulated or real recording and can be combined."""
