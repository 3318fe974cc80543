"""A combination of data set, disturbances, attitude, filter, adaptation and noise: labels, key, provenance."""
