"""Reading and writing files of recordings and trajectories. This package has no plugins.

Tables: `text` and `tracks` read formats, and `readers` selects the format of a file. `columns` contains the result.
`conversions` converts times, and values to ENU and to body axes, and `table` creates the streams of a recording.

Bags: `bag` reads messages and describes topics, `bag_topics` contains the roles of topics and drops or repairs damaged
messages, and `bag_dataset` creates the recording. `bag_writing` writes bags.

`sanitiser` contains the checks of all readers. `trajectory` reads trajectories, and `writing` exports recordings.
"""
