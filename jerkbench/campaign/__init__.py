"""Tuning, the suite and the audit: settings are tried on some runs, chosen, and scored on runs that were not used."""
