"""Estimators over kinematic filters, compiled: square covariances, so that they can be mixed."""
