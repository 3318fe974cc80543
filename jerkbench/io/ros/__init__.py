"""ROS bags: topics -> arrays -> cleaned streams -> a recording; and a recording as a bag.

`bag` and `decode` read messages (`bulk` many at once, `salvage` what is damaged), `roles` says what each topic is,
`extract` keeps what was read, `cleaning` and `streams` make the parts of a recording, `assembly` the whole.
"""
