"""Reading and writing files of recordings and trajectories. This package has no plugins.

Tables: `columns` contains the columns of a table and reads them from text, `column_names` contains the
spellings of common loggers, `tracks` reads formats of receivers, and `readers` selects the format of a file.
`conversions` converts times, and values to ENU and to body axes, and `table` creates the streams of a recording.

Bags: `bag` reads messages and describes topics, `bag_topics` contains the roles of topics and drops or repairs damaged
messages, and `bag_dataset` creates the recording. `bag_writing` writes bags.

`fetching` downloads public recordings. `files` finds and reads files, and `sanitiser` contains the checks of all
readers. `trajectory` reads trajectories, and `writing` exports recordings.
"""
