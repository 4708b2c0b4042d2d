"""What a world's bundle proves: measures of the compiled model against the plan, the real rock, and real LiDAR."""
