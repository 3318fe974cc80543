"""Parts that compiled estimators share: the adaptation's call, room for results, the sums of a run, threads."""
