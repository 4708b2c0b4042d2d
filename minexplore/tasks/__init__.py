"""What a robot drives for: the tasks, of which an environment has one."""
