"""Adaptations: plugins that change R, the prior covariance or the Kalman gain, depending on the innovations."""
