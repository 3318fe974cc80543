"""Traces: what a real receiver's fixes were off by, and what it said of them."""
