"""What the shell is worth, place by place: rock in the free space, and free surface without rock of 2 cm behind it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.geometry.facets.separation import Facets
from pipeline.volume.rock.cleared import parts_not_cleared
from pipeline.volume.rock.depth import Depth, deepest
from pipeline.volume.rock.faces import PartFaces, faces_on_facets
from pipeline.volume.rock.gaps import SurfaceGap, widest_gap
from pipeline.volume.rock.intruding_volume import shared_m3
from pipeline.volume.rock.ragged import middles_of, parts_of
from pipeline.volume.rock.tiles import Tile
from pipeline.volume.shell import SLIVER_M2, THIN_M, ShellPart
from pipeline.volume.union import Volume

_MM = 1e3
_LEAST_M3 = 1e-12  # of a part in the free space, a thousandth of a cubic millimetre: less is rounding


@dataclass(frozen=True)
class Enclosure:
    """How far rock reaches into the free space, and how wide a circle is before which it is missing or thin.

    Attributes
    ----------
    intrusion : Depth
        The largest distance from the surface of the free space that a part has in it.
    gap, thin : SurfaceGap
        The widest circle on the surface without a part behind it, and without one that reaches 2 cm into the rock.
    unbacked : (n, 3) float64, m
        The middles of parts that lie behind no facet.
    surface_m2 : float
    thinnest_m : float
    full_share : float
        Of the surface behind which the rock is 0.3 m thick.
    """

    intrusion: Depth
    gap: SurfaceGap
    thin: SurfaceGap
    unbacked: np.ndarray
    surface_m2: float
    thinnest_m: float
    full_share: float

    @property
    def figures(self) -> dict[str, Any]:
        """Return the figures by name, and of those that have a place, in the frame of the volume, where it is."""
        worst = {
            "intrusion": (self.intrusion.depth_m, self.intrusion.place_m),
            "gap": (self.gap.width_m, self.gap.place_m),
            "thin": (self.thin.width_m, self.thin.place_m),
        }
        return {
            **{f"{name}_mm": round(_MM * size, 3) for name, (size, _) in worst.items()},
            **{f"{name}_at": describe_place(place) for name, (size, place) in worst.items() if size > 0},
            "unbacked": len(self.unbacked),
            **({"unbacked_at": describe_place(self.unbacked[0])} if len(self.unbacked) else {}),
            "surface_m2": round(self.surface_m2, 3),
            "thinnest_mm": round(_MM * self.thinnest_m, 6),
            "full_share": round(self.full_share, 6),
        }


def describe_place(place_m: np.ndarray) -> str:
    """Return a place (3,) m in words, to the centimetre."""
    return "({:.2f}, {:.2f}, {:.2f}) m".format(*place_m)


def measure_enclosure(volume: Volume, parts: list[ShellPart], faces: PartFaces | None = None) -> Enclosure:
    """Measure the shell against the free space.

    Booleans measure each part of which planes do not show that no facet reaches into it, or whose middle is in the free
    space. What of a facet has no part behind it is found in its plane. `faces` are those of `faces_on_facets`, if they
    are known.
    """
    facets, size = Facets(volume.vertices, volume.faces), np.linalg.norm(volume.normals, axis=1)
    corners = parts_of([part.corners for part in parts])
    faces = faces or faces_on_facets(volume, corners)
    front = np.array([max(part.facets, key=size.__getitem__) for part in parts], int)
    depth, area = np.array([part.depth_m for part in parts]), np.array([part.area_m2 for part in parts])
    middles = middles_of(corners)
    inside = volume.inside
    doubtful = set(parts_not_cleared(volume, corners, -facets.normals[front]).tolist())
    doubtful |= set(np.flatnonzero(inside.rays_say_free(middles)).tolist())
    bodies = [corners[k] for k in sorted(doubtful)]
    # Part by part: the union of parts that touch each other once gave 2.5 m3 of rock where there is none.
    shared = shared_m3(facets, bodies, inside.are_free)
    intruding = [body for body, free_m3 in zip(bodies, shared.tolist(), strict=True) if free_m3 > _LEAST_M3]
    gap = widest_gap(facets, faces)
    return Enclosure(
        deepest(intruding, Tile.of(volume.solid), inside, facets.corners),
        gap,
        widest_gap(facets, faces, THIN_M) if (faces.depth_m < THIN_M).any() else gap,
        np.delete(middles, faces.part, axis=0),
        float(size.sum() / 2),
        float(depth[area > SLIVER_M2].min()),
        float(area[depth > 0.299].sum() / area.sum()),
    )
