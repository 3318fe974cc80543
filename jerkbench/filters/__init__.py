"""The built-in filters and smoothers, and filters that read the estimates of external programs."""
