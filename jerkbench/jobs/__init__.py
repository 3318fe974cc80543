"""Jobs: combinations of a scenario and a method with all their seeds, from plugin names to stored rows.

The module `job` defines a job, `names` creates jobs from plugin names, and `key` hashes everything that the rows of a
job depend on. The module `plan` divides jobs into tasks. The module `run` sends the tasks to the workers of
`executors`, and `rows` computes the rows of a task from the shared `inputs`. The module `store` writes and reads the
rows, and `manifest` describes the commands of a study. The module `study` combines the stored rows with the manifest,
and `replay` runs a stored row again.
"""
