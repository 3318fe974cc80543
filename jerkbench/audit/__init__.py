"""The audit of the adaptive filters: each against an equally tuned plain Kalman filter, scored on unseen faults."""
