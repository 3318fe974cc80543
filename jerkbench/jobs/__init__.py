"""One combination with all its seeds: what it is, its key, its inputs, its rows, and where it runs.

`cell` says what is run and `names` makes it from names, `key` what its rows depend on, `inputs` what runs share, `rows`
runs it. `cluster` opens workers (`pool`: our own processes; `dask_cluster`), and `dispatch` sends tasks to them.
"""
