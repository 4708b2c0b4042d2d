"""Stage 4: the visible rock. Where its roughness comes from, its noise, walls, mesh, checks and texture."""
