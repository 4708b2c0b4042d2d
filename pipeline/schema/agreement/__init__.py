"""Whether `mine.xml`, `world.json` and the files of a bundle say the same."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from minexplore.bundle import MESHES, MODEL, RECORD, BundleError, has_visible_rock
from pipeline.schema.agreement.comparison import ModelElements
from pipeline.schema.agreement.rock import check_boxes, check_rock, check_zones
from pipeline.schema.agreement.views import check_cameras, check_lights, check_look, check_pose, check_surface
from pipeline.schema.fittings import check_fittings
from pipeline.schema.readers.xml import Node
from pipeline.schema.rough_floor import check_rough_floor


def check_agreement(root: Node, record: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
    """Refuse a model that differs from its record, or names other meshes than the bundle has.

    Parameters
    ----------
    root : Node
        `mine.xml`, which the table of elements allows.
    record : dict
        `world.json`, which the table of fields allows.
    files : dict
        By name.

    Raises
    ------
    BundleError
        With the path of the first difference.
    """
    at = ModelElements(root)
    if root.attributes["model"] != record["name"]:
        raise BundleError(f"{MODEL}: mujoco@model: {root.attributes['model']!r}, {RECORD} says {record['name']!r}")
    check_look(at, record)
    check_pose(at, record)
    check_rock(at, record)
    check_zones(at, record)
    check_boxes(at, record)
    check_cameras(at, record)
    check_lights(at, record)
    if has_visible_rock(record):
        check_surface(at, {name for name in files if name.startswith(MESHES)})
    check_rough_floor(at.of_mine, at.of_assets, record, files)
    check_fittings(at.fittings, at.of_assets, record)
