"""Stage 4: model the visible rock: a smooth octagonal surface under a rough one (metres, mine frame)."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.params.surface import SurfaceParams, TextureParams
from pipeline.places import EXTENT, SMOOTH, TEXTURE
from pipeline.progress import progress
from pipeline.stage import Artifact, Stage, by_model, main
from pipeline.store.codecs import Bundle, Meshes, decode
from pipeline.store.mine_survey import MineSurvey
from pipeline.surface.build import build_rough_surface, chunk_files, lay_rough_lattice, widen_spacing
from pipeline.surface.mesh.mesh_checks import check_mesh, join_meshes
from pipeline.surface.mesh.rough import RoughSurface, check_rough, closed_mesh
from pipeline.surface.mesh.smooth import smooth_surface
from pipeline.surface.reference import measure_sources, reference_files
from pipeline.surface.relief_source import choose_relief
from pipeline.surface.roughness_report import RoughnessReport, amplitude_table, report_roughness
from pipeline.surface.texture.layers import Layers, make_rock_texture
from pipeline.surface.texture.picture import make_texture
from pipeline.types import (
    ClosedMesh,
    DriftNetwork,
    FreeSpace,
    Image,
    SolidExtent,
)


def model_surface(params: SurfaceParams, mine: MineSurvey, **inputs: Any) -> dict[str, Any]:
    """Return the visible rock with its texture, and reports on it; nothing with `overlay=none`.

    A level mine has a smooth surface under a rough one. A volume has a rough surface of its walls and roofs alone: of a
    scan the volume's own, where its points are.
    """
    return {"rock": {}, "evidence": {}} if params.overlay == "none" else _visible_rock(params, mine, **inputs)


def _rock_of_level(
    params: SurfaceParams, mine: MineSurvey, free_space: FreeSpace, topology: DriftNetwork, compiled: Path
) -> dict[str, Any]:
    free, height_m = free_space.polygon, decode(compiled / EXTENT, SolidExtent).height_m
    params = widen_spacing(params, free, height_m)
    with progress("surface", 6, "steps") as done:
        rough, reported = _rough(params, free, topology, height_m, done.update)
        smooth, texture = _smooth(params, free, height_m), _texture(params.texture)
        done.update()
        rock = {**chunk_files(rough, params), SMOOTH: smooth, TEXTURE: texture}
        done.update()
        return {"rock": rock, "evidence": _evidence(rough, smooth, reported, height_m)}


def _rock_of_volume(
    params: SurfaceParams, mine: MineSurvey, free_space: FreeSpace, topology: DriftNetwork, compiled: Path
) -> dict[str, Any]:
    from pipeline.volume.world.surface.build import rock_of_volume  # open3d takes a second to load

    scan = (mine.shape.scan_m, mine.shape.scan_rgb) if isinstance(mine.shape, ClosedMesh) else ()
    rock = rock_of_volume(params, compiled, _texture(params.texture), *scan)
    return {"rock": {**rock.files, TEXTURE: rock.texture}, "evidence": {"mesh_checks.json": rock.report}}


_visible_rock = by_model(level=_rock_of_level, volume=_rock_of_volume)


def _rough(
    params: SurfaceParams, free: Polygon, topology: DriftNetwork, height_m: float, done: Callable[[], Any]
) -> tuple[RoughSurface, RoughnessReport]:
    """Return the rough surface and the report on its roughness; `done` is called after each of three steps."""
    sources = measure_sources(params)
    lattice = lay_rough_lattice(params, free, topology, height_m)
    relief = choose_relief(params, sources, lattice)
    done()
    rough = build_rough_surface(params, lattice, relief)
    done()
    reported = report_roughness(params, sources, relief, rough)
    done()
    return rough, reported


def _evidence(rough: RoughSurface, smooth: Meshes, reported: RoughnessReport, height_m: float) -> dict[str, Any]:
    """Return what no other stage reads."""
    from pipeline.report.figures.roughness import draw_sections, draw_spectra  # Matplotlib takes 0.4 s to load

    return {
        "sections.png": draw_sections(rough, smooth, height_m),
        "amplitude.csv": amplitude_table(rough),
        "roughness.json": reported,
        "roughness.png": draw_spectra(reported),
        "mesh_checks.json": check_rough(rough, closed_mesh(rough)[1]),
    }


def _smooth(params: SurfaceParams, free: BaseGeometry, height_m: float) -> Meshes:
    """Return the smooth surface, checked to be closed."""
    smooth = smooth_surface(free, height_m, params.floor_chamfer_m, params.roof_chamfer_m, params.texture.repeat_m)
    check_mesh(*join_meshes(smooth))
    return smooth


def _texture(params: TextureParams) -> Image:
    rng = np.random.default_rng(params.seed)
    if params.layers:
        layers = Layers(**params.layers.model_dump())
        return make_rock_texture(params.size_px, params.repeat_m, params.rgb, layers, params.colours, rng)
    return make_texture(params.size_px, params.spectral_exponent, params.contrast, params.rgb, rng)


STAGE = Stage(
    name="surface",
    run=model_surface,
    sources=reference_files,
    reads={
        "mine": Artifact("survey/mine", MineSurvey),
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "compiled": Artifact("compile3d/compiled", Bundle),
    },
    writes={"rock": Artifact("surface/rock", Bundle), "evidence": Artifact("surface/evidence", Bundle)},
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
