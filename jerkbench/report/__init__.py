"""Rows -> tables and figures."""
