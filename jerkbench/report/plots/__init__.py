"""Figures, one function each: data in, figure out."""
