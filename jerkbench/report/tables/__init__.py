"""Rows of runs -> tables, and their writers."""
