"""Files: what a recording or a trajectory is read from and written to. No plugin.

Tables: `text`, `tracks`, `rtklib` and `columns` read them, `column_names` knows what loggers call their columns,
`frames` turns values into ENU and the body's axes, and `table` makes streams of them. Bags: `bag` reads messages,
`bag_topics` assigns roles to topics, `bag_cleaning` drops or repairs what is wrong, and `bag_dataset` makes the
recording; `bag_writing` writes bags, and `bag_survey` counts the messages of a bag. `clocks` converts times, and
`sanitiser` contains the checks of all readers. `trajectory` reads and writes trajectories. `recording_folder` and
`writing` export recordings.
"""
