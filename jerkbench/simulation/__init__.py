"""Simulation of drives: true motion of a vehicle, and measurements of its sensors."""
