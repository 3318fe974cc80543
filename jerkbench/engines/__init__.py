"""Engines that run a filter with an adaptation over a timeline; same inputs, same outputs."""
