"""Files -> plain arrays, and what is done to them before they become a recording. No plugin, no parameter file."""
