"""The engines, which run a filter with an adaptation over a timeline. All engines have the same inputs and outputs.

The kernel of the engine `compiled` is in `jerkbench/kinematic/`.
"""
