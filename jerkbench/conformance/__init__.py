"""What every plugin of a kind has to fulfil, as checks; `jerkbench.testing` is their public face."""
