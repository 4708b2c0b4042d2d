"""Proofs about a bundle: comparison of the compiled model with the plan, with real rock and with real LiDAR."""
