"""Robots with further sensors: images, clouds, odometry, and what dust and water do to them."""
