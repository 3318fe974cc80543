"""The audit of attitude filters: each tuned alike, domain by domain, against a plain Kalman filter and VQF."""
