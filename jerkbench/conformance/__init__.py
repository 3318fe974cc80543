"""The contract of each kind of plugin, as checks; `jerkbench.testing` is their public face."""
