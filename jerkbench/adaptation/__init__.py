"""Rules that adapt R (or fade P) from the innovations; one file a rule."""
