"""Normals are compared within what 32 bits change in the places that they are made of, and no further."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline.errors import ArtifactError
from pipeline.proof.rebuilt.shading import JoinedRock, require_shading
from pipeline.surface.mesh.normals import shade_mesh
from pipeline.types import Mesh


def ball_with_needles(away_m):
    """Return places and faces of a ball far from the origin; 40 of its edges are cut 0.8 mm from an end."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=4.0)
    places, faces = np.array(ball.vertices), np.array(ball.faces)
    for edge in ball.edges_unique[::48][:40]:
        a, b = places[edge]
        places = np.vstack([places, a + 0.0008 * (b - a) / np.linalg.norm(b - a)])
        at = np.flatnonzero(np.isin(faces, edge).sum(axis=1) == 2)
        if len(at) == 2:
            parts = [np.where(face == old, len(places) - 1, face) for face in faces[at] for old in edge]
            faces = np.vstack([np.delete(faces, at, axis=0), parts])
    return places + away_m, faces


def stored(places, faces, normals):
    uv = np.zeros((len(places), 2), np.float32)
    return {"roof_00_00": Mesh(places.astype(np.float32), faces.astype(np.int32), uv, normals.astype(np.float32))}


@pytest.mark.parametrize("away_m", [0.0, 240.0, 4000.0])
def test_normals_at_needles_hold_however_far_from_the_origin(away_m):
    places, faces = ball_with_needles(away_m)
    shaded = shade_mesh(places, faces)
    chunks = stored(places[shaded.source], shaded.faces, shaded.normals)
    require_shading(Path("world"), chunks, JoinedRock.of(list(chunks.values())))


def test_a_normal_turned_by_a_quarter_of_a_degree_is_refused():
    places, faces = ball_with_needles(240.0)
    shaded = shade_mesh(places, faces)
    normals = shaded.normals.copy()
    normals[7] += 0.004 * np.cross(normals[7], [0.0, 0.0, 1.0])
    chunks = stored(places[shaded.source], shaded.faces, normals / np.linalg.norm(normals, axis=1, keepdims=True))
    with pytest.raises(ArtifactError, match=r"not that of its faces; 1 vertices have other ones"):
        require_shading(Path("world"), chunks, JoinedRock.of(list(chunks.values())))
