"""Episodes recorded as robots' sensors give them, for ROS 2 and for a browser."""
