"""How ledges are folded: where walls are steps between floors, and the mesh that is cut at their corners."""
