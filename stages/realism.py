"""Stage 5: tilt the mine, add floor zones and lights, and write the world bundle."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from pipeline.errors import ParamsError
from pipeline.mjcf.assemble import assemble_world
from pipeline.params.realism import RealismParams
from pipeline.stage import Artifact, Stage, by_model, main
from pipeline.store.codecs import Bundle
from pipeline.store.mine_survey import MineSurvey
from pipeline.types import DriftNetwork, FreeSpace


def _write_level(params: RealismParams, mine: MineSurvey, **inputs: Any) -> dict[str, Bundle]:
    return {"world": assemble_world(params, mine.survey, **inputs)}


def _write_volume(
    params: RealismParams,
    mine: MineSurvey,
    free_space: FreeSpace,
    topology: DriftNetwork,
    compiled: Path,
    rock: Path,
) -> dict[str, Bundle]:
    if params.rough_floor:
        raise ParamsError(
            "realism.rough_floor = true: the mine is one volume, whose robots stand on its floors; want false"
        )
    from pipeline.volume.world.bundle import bundle_volume  # open3d takes a second to load

    return {"world": bundle_volume(params, mine.survey, free_space, compiled, rock)}


write_world = by_model(level=_write_level, volume=_write_volume)  # returns the files of the bundle by name

STAGE = Stage(
    name="realism",
    run=write_world,
    reads={
        "mine": Artifact("survey/mine", MineSurvey),
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "compiled": Artifact("compile3d/compiled", Bundle),
        "rock": Artifact("surface/rock", Bundle),
    },
    writes={"world": Artifact("realism/world", Bundle)},
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
