"""Methods from elsewhere: their trajectories, and programs that make them."""
