"""The audit: of the published adaptive filters, how many beat an equally tuned plain Kalman filter?"""
