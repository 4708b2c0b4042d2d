"""ROS occupancy grids."""
