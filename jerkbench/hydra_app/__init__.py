"""The Hydra application that runs `jerkbench run`."""
