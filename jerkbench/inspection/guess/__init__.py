"""The guess of what the columns of an unknown table are, with the reasons, and the preset that says so."""
