"""Stage 4: the visible rock. Reference roughness, noise, walls, mesh, mesh checks and texture."""
