"""The clusters that a sweep can run on: the own processes, or any engine that is a `concurrent.futures.Executor`."""
