"""ROS bags: opening them, choosing topics, and turning messages into arrays."""
