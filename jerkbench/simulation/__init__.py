"""A simulated drive: its true motion, and what the sensors make of it."""
