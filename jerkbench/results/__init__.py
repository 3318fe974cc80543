"""Results on the disk: the store, a study's folder, replays of stored rows, its figures."""
