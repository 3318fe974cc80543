"""The catalogue: every plugin and preset by name, with its equations and parameters, for people and for programs."""
