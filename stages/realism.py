"""Stage 5: tilt the mine, add floor zones and lights, and write the world bundle."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from minexplore.bundle import VOLUME
from pipeline.errors import ParamsError
from pipeline.mjcf.assemble import assemble_world
from pipeline.params.realism import RealismParams
from pipeline.stage import Artifact, Stage, main
from pipeline.store.codecs import Bundle, Meshes
from pipeline.types import ConvexParts, DriftNetwork, FreeSpace, Image, SolidExtent, Spawn, Survey


def write_world(params: RealismParams, survey: Survey, free_space: FreeSpace, volume: Path, **others: Any) -> dict:
    """Return `world`, the files of the bundle by name: of one volume, or of a level mine.

    Raises
    ------
    ParamsError
        If a volume is to have a rough floor.
    """
    if not (volume / VOLUME).is_file():
        return assemble_world(params, survey, free_space, **others)
    if params.rough_floor:
        raise ParamsError("realism.rough_floor = true: the mine is one volume, which has no visible floor; want false")
    from pipeline.volume.world.bundle import bundle_volume  # open3d takes a second to load

    return {"world": bundle_volume(params, survey, free_space, volume, others["rough"], others["texture"])}


STAGE = Stage(
    name="realism",
    run=write_world,
    reads={
        "survey": Artifact("survey/survey.json", Survey),
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "extent": Artifact("compile3d/extent.json", SolidExtent),
        "collision": Artifact("compile3d/collision.npz", ConvexParts),
        "spawn": Artifact("compile3d/spawn.json", Spawn),
        "volume": Artifact("compile3d/volume", Bundle),
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
