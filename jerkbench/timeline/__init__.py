"""(Recording, Attitude) -> Timeline: the events of a run in the order in which they were true."""
