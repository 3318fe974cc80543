"""Jobs: creation, execution and storage. A job is a combination of a scenario and a method, with all its seeds.

The module `job` defines a job, and `names` creates jobs from plugin names. The module `key` computes a hash of all that
the result rows of a job depend on, and writes and reads the manifest, which describes the commands of a study. The
module `plan` divides the jobs of a sweep into tasks. The module `run` sends the tasks to the worker processes of
`executors`. The module `rows` computes the rows of a task, and caches the recordings that several runs use.
The module `store` writes and reads the rows. The module `study` combines the stored rows with the manifest, and runs a
stored row again.
"""
