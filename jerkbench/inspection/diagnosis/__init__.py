"""The doctor: mistakes that a person makes in a log, found by what its streams say of each other."""
