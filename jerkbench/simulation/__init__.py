"""A simulated drive: its true motion, and the measurements of its sensors."""
