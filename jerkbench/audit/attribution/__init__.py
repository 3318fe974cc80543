"""The attribution: what the gain of jerk and MTF over a naive baseline is made of."""
