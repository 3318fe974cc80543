"""Jobs: one combination with all its seeds, from its names to its stored rows.

`job` defines a job and `names` makes one from names; `key` hashes all that its rows depend on. `plan` divides jobs into
tasks. `run` sends the tasks to the workers of `executors`, and `rows` computes their rows from the shared `inputs`.
`store` writes and reads the rows, `manifest` describes the commands, `study` joins both, and `replay` runs a row again.
"""
