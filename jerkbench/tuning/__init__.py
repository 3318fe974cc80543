"""Tuning: settings tried on some runs, chosen on others, scored on runs that neither has seen."""
