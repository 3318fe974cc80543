"""One combination with all its seeds: what it is, its key, its inputs, its rows, where it runs and what is kept of it.

`job` says what is run and `names` makes it from names, `key` what its rows depend on, `inputs` what runs share, `rows`
runs it. `plan` cuts tasks, `run` is the loop, `dispatch` sends tasks to the workers that `cluster` opens. `store` keeps
the rows in `parts`; `study` is its folder with manifest and tables, `replay` runs a row again, `study_figures` draws.
"""
