"""The picture of a survey as one volume: the floors of Wheal Pell from above, and a long section of its legs."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from pipeline.compose import compose
from pipeline.params.survey import PassageSurveyParams
from pipeline.report.figures.style import to_image
from pipeline.report.figures.volume import draw_floors, draw_section
from pipeline.store.codecs import encode
from pipeline.store.files import write_atomically
from pipeline.survey.load import read_survey
from pipeline.volume.floors import solve_floors
from pipeline.volume.world.cells import cells_of
from pipeline.volume.world.compile import robot_size
from pipeline.volume.world.content import in_mine_frame
from pipeline.volume.world.topology import leg_network, mine_network, start_of

SURVEY = "data/wheal_pell/pell.3d"
_WIDTH_PX = 1200


def draw_volume(path: Path) -> None:
    """Draw the longest piece of Wheal Pell; it needs no collision parts."""
    params = compose([]).compile3d
    surveyed = read_survey(PassageSurveyParams(kind="passages", name="pell", file=SURVEY))["network"]
    network, offset = mine_network(surveyed, params.height_m, params.volume)
    volume = in_mine_frame(solve_floors(network), offset)
    robot = robot_size(params.volume)
    cells, legs = cells_of(volume, params.grid_cell_m, robot), leg_network(network, offset, ())
    start = start_of(cells, legs, None, params.spawn, robot)
    ends, floors, roofs = (places + offset for places in (network.ends_m, network.floors_m, network.ends_m))
    roofs = roofs + network.lrud_m[:, :, 2, None] * [0, 0, 1.0]
    figures = (
        draw_floors(cells.places_m, cells.cell_m, list(ends), start.anchor_m, surveyed.datum_m),
        draw_section(floors, roofs, surveyed.datum_m),
    )
    pictures = [_as_wide(to_image(figure)) for figure in figures]
    write_atomically(path, encode(path, cv2.vconcat(pictures)))


def _as_wide(picture: np.ndarray) -> np.ndarray:
    size = (_WIDTH_PX, round(picture.shape[0] * _WIDTH_PX / picture.shape[1]))
    found: np.ndarray = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return found
