"""Files: what a recording or a trajectory is read from and written to. No plugin.

The way of a table: `text`, `tracks` and `columns` read it, `frames` turns it into ENU and the body's axes, `table`
makes its streams. The way of a bag: `bag` and `bag_decode` read messages,
`bag_roles` says what each topic is, `bag_extract` keeps what was read, `bag_streams` makes the parts of a recording,
`bag_assembly` the whole; `bag_writing` is the way back. `sanitiser` finds what is wrong in either.
"""
