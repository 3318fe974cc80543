"""ROS bags: topics -> arrays -> cleaned streams -> a recording; and a recording as a bag.

`bag` and `decode` read messages (`salvage` what is whole of a damaged bag), `roles` says what each topic is,
`extract` keeps what was read, `streams` makes the parts of a recording, `assembly` the whole.
"""
