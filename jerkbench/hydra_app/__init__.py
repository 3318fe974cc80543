"""The Hydra app behind `jerkbench run`."""
