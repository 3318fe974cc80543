"""Motion models of one axis, and estimators of another kind."""
