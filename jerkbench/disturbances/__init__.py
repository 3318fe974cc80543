"""Recording -> Recording; small, composable, for simulated and real recordings alike."""
