"""Which facets of the free space each collision part lies behind, by their planes alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from minexplore.floors.volume_arrays import Parts
from pipeline.volume.rock.faces import PartFaces, faces_on_facets
from pipeline.volume.shell import ShellPart
from pipeline.volume.union import Volume

_SEEN_M2 = 1e-3  # labels of parts with smaller faces are not compared


@dataclass(frozen=True)
class Fronts:
    """The parts as `pipeline.volume.enclosure` measures them.

    A part that lies behind no facet is among them with no area. `mislabelled` counts parts that lie behind no
    facet of their label: their friction or their group is wrong. Parts whose largest face on a facet is under 10 cm2
    are left out. `faces` are those of the parts on facets.
    """

    parts: list[ShellPart]
    mislabelled: int
    faces: PartFaces


def fronts_of(volume: Volume, parts: Parts) -> Fronts:
    """Find the face of each part that lies on the plane of a facet, with all of the part behind it.

    Of several planes the one with the largest face counts; its area is what of facets the part is behind, as a sliver's
    plane may hold more of the part than the sliver.
    """
    faces = faces_on_facets(volume, parts)
    covered = np.bincount(faces.part, shapely.area(faces.shared), len(parts))
    area = np.minimum(faces.area_m2, covered[faces.part])
    found = [
        ShellPart(parts[k], [int(faces.facet[n])], "built", float(faces.depth_m[n]), float(area[n]))
        if n >= 0
        else ShellPart(parts[k], [0], "built", 0.0, 0.0)
        for k, n in enumerate(faces.largest(len(parts)).tolist())
    ]
    wrong = np.array([part.area_m2 > _SEEN_M2 for part in found])
    wrong[faces.part[volume.label[faces.facet] == parts.label[faces.part]]] = False
    return Fronts(found, int(wrong.sum()), faces)
