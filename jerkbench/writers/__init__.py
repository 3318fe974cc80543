"""A recording as a file: a ROS bag, a table, a trajectory."""
