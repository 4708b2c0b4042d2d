"""Chunks of a volume's rock: walls and roofs by tiles of the plan, with texture and normals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from minexplore.bundle import ROOF as ROOF_CHUNKS
from minexplore.bundle import WALLS, chunk_mesh
from pipeline.params.surface import SurfaceParams
from pipeline.surface.chunks import merge_single_faces
from pipeline.surface.mesh.lattice import ROOF, WALL
from pipeline.surface.mesh.normals import shade_mesh
from pipeline.surface.mesh.simplify import SurfaceMesh
from pipeline.types import Image, Mesh
from pipeline.volume.world.surface.charts import Charts, charts_of, packed, repeated
from pipeline.volume.world.surface.displace import DisplacedRock
from pipeline.volume.world.surface.fine import FLOOR
from pipeline.volume.world.surface.painted import paint
from pipeline.volume.world.surface.scanned import ScanColours
from pipeline.volume.world.surface.texture import facing_sides, lay_texture, texture_groups

_NAMES = {WALL: WALLS, ROOF: ROOF_CHUNKS}


def cut_rock(
    rock: DisplacedRock, params: SurfaceParams, texture: Image, colours: ScanColours
) -> tuple[dict[str, Mesh], Image]:
    """Cut the rock without its floors into square tiles of the plan; faces face the workings.

    Normals are those of the whole surface, so that chunks meet without a break. Returns the chunks by name and their
    picture: the texture, which repeats, or with the colours of a scan one in which each piece of rock has a place.
    """
    rock = replace(rock, mesh=_without_floors(rock.mesh))
    mesh, build = rock.mesh, params.rough
    group = texture_groups(rock)
    laid, offset = lay_texture(rock, group, params.texture.tether_m)
    shaded = shade_mesh(mesh.vertices, mesh.faces, build.crease_deg)
    tile = _tiles(mesh, build.tile_m)
    kind = np.column_stack([mesh.piece, tile])
    if len(colours):
        charts, texture = _painted(rock, params, texture, colours, np.column_stack([kind, group]), (laid, offset))
    else:
        charts = repeated(group, laid.shape[2], params.texture.repeat_m)
    order = np.lexsort((*tile.T[::-1], mesh.piece))
    key = kind[order]
    chunks = {}
    for part in np.split(order, np.flatnonzero(np.any(np.diff(key, axis=0) != 0, axis=1)) + 1):
        corner = shaded.faces[part].astype(np.int64) * len(charts) + charts.number[part][:, None]
        used, faces = np.unique(corner, return_inverse=True)
        vertex, chart = used // len(charts), used % len(charts)
        source = shaded.source[vertex]
        chunks[chunk_mesh(_NAMES[int(mesh.piece[part[0]])], *tile[part[0]].tolist())] = Mesh(
            mesh.vertices[source],
            faces.reshape(-1, 3).astype(np.int32),
            (laid[source, :, charts.way[chart]] + offset[source] + charts.shift_m[chart]) / charts.across_m,
            shaded.normals[vertex] if build.normals else None,
        )
    return chunks, texture


def _painted(
    rock: DisplacedRock,
    params: SurfaceParams,
    texture: Image,
    colours: ScanColours,
    kind: np.ndarray,
    laid: tuple[np.ndarray, np.ndarray],
) -> tuple[Charts, Image]:
    """Return charts of the connected faces of one kind (m, 4) that face one side, and their picture.

    `laid` are the coordinates (n, 2, groups) m of the vertices, and what is added to them (n, 2) m.
    """
    faces, group = rock.mesh.faces, kind[:, -1]
    number = charts_of(faces, np.column_stack([kind, facing_sides(rock, group)]))
    corners = laid[0][faces, :, group[:, None]] + laid[1][faces]
    charts, side = packed(number, group, corners, params.texture.scan_px)
    own = params.texture
    return charts, paint(rock.mesh.vertices, faces, corners, charts, side, colours, texture, own.repeat_m)


def _without_floors(mesh: SurfaceMesh) -> SurfaceMesh:
    kept = mesh.piece != FLOOR
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    return SurfaceMesh(mesh.vertices[used], faces, mesh.piece[kept], mesh.source[used])


def _tiles(mesh: SurfaceMesh, tile_m: float) -> np.ndarray:
    """Return the column and row (m, 2) of each face's tile; faces alone in one join the nearest tile of their piece."""
    centre = mesh.vertices[mesh.faces].mean(axis=1)[:, :2]
    tile = np.floor((centre - mesh.vertices[:, :2].min(axis=0)) / tile_m).astype(np.int64)
    for part in (mesh.piece == piece for piece in np.unique(mesh.piece)):
        tile[part] = merge_single_faces(tile[part], centre[part])
    return tile
