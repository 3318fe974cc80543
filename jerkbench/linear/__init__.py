"""Estimators over kinematic filters, made of their kernel: compiled for one run, and for several side by side."""
