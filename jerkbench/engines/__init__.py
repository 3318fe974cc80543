"""Engines that run a filter with an adaptation over a timeline; same inputs, same outputs.

The kernel of the compiled one is in `jerkbench/kinematic/`.
"""
