"""Tuning, benchmark suite and audit of filters: parameters are selected on some runs and scored on other runs."""
