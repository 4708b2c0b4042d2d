"""Stage 5: tilt the mine, add floor zones and lights, and write the world bundle."""

from __future__ import annotations

import sys

from minexplore.floors.floor import Floor
from pipeline.mjcf.assemble import assemble_world
from pipeline.stage import Artifact, Stage, main
from pipeline.store.codecs import Bundle, Meshes
from pipeline.types import ConvexParts, DriftNetwork, FreeSpace, Image, Openings, SolidExtent, Spawn, Survey

STAGE = Stage(
    name="realism",
    run=assemble_world,
    reads={
        "survey": Artifact("survey/survey.json", Survey),
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "openings": Artifact("compile3d/openings.json", Openings),
        "extent": Artifact("compile3d/extent.json", SolidExtent),
        "collision": Artifact("compile3d/collision.npz", ConvexParts),
        "floor": Artifact("compile3d/floor.npz", Floor),
        "spawn": Artifact("compile3d/spawn.json", Spawn),
        "smooth": Artifact("surface/smooth.npz", Meshes),
        "texture": Artifact("surface/texture.png", Image),
        "rough": Artifact("surface/rough", Bundle),
        # The bundle holds unchanged copies of these.
        "occupancy": Artifact("compile3d/occupancy.npz", bytes),
        "free_space_bt": Artifact("compile3d/free_space.bt", bytes),
        "map_png": Artifact("compile3d/map.png", bytes),
        "map_yaml": Artifact("compile3d/map.yaml", bytes),
    },
    writes={"world": Artifact("realism/world", Bundle)},
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
