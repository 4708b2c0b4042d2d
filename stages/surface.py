"""Stage 4: model the visible rock: a smooth octagonal surface under a rough one (metres, mine frame)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from minexplore.bundle import VOLUME
from pipeline.params.surface import SurfaceParams, TextureParams
from pipeline.stage import Artifact, Stage, main
from pipeline.store.codecs import Bundle, Meshes
from pipeline.surface.build import build_rough_surface, chunk_files, lay_rough_lattice, widen_spacing
from pipeline.surface.mesh.mesh_checks import MeshReport, check_mesh, join_meshes
from pipeline.surface.mesh.rough import RoughSurface, check_rough, closed_mesh
from pipeline.surface.mesh.smooth import smooth_surface
from pipeline.surface.reference import measure_sources, reference_files
from pipeline.surface.relief_source import choose_relief
from pipeline.surface.roughness_report import RoughnessReport, amplitude_table, report_roughness
from pipeline.surface.texture.layers import Layers, make_rock_texture
from pipeline.surface.texture.picture import make_texture
from pipeline.types import (
    NO_PICTURE,
    NO_SOLID,
    ClosedMesh,
    DriftNetwork,
    FreeSpace,
    Image,
    SolidExtent,
)


def model_surface(
    params: SurfaceParams,
    free_space: FreeSpace,
    topology: DriftNetwork,
    extent: SolidExtent,
    volume: Path | None = None,
    solid: ClosedMesh = NO_SOLID,
) -> dict[str, Any]:
    """Return both surfaces, the texture, and reports on roughness and meshes; with `overlay=none` all are empty.

    A survey that is built as one volume has a rough surface alone, which is that of the volume's walls and roofs: of
    a scan the volume's own, where its points are.
    """
    if params.overlay == "none":
        return _NO_ROCK
    if volume is not None and (volume / VOLUME).is_file():
        from pipeline.volume.world.surface.build import rock_of_volume  # open3d takes a second to load

        rock = rock_of_volume(params, volume, _texture(params.texture), solid.scan_m, solid.scan_rgb)
        return {**_NO_ROCK, "rough": rock.files, "texture": rock.texture, "mesh_checks": rock.report}
    free, height_m = free_space.polygon, extent.height_m
    params = widen_spacing(params, free, height_m)
    rough, reported = _rough(params, free, topology, height_m)
    smooth, texture = _smooth(params, free, height_m), _texture(params.texture)
    evidence = _evidence(rough, smooth, reported, height_m)
    return {"smooth": smooth, "rough": chunk_files(rough, params), "texture": texture, **evidence}


def _rough(
    params: SurfaceParams, free: Polygon, topology: DriftNetwork, height_m: float
) -> tuple[RoughSurface, RoughnessReport]:
    """Return the rough surface, and how rough it is beside what it copies."""
    sources = measure_sources(params)
    lattice = lay_rough_lattice(params, free, topology, height_m)
    relief = choose_relief(params, sources, lattice)
    rough = build_rough_surface(params, lattice, relief)
    return rough, report_roughness(params, sources, relief, rough)


def _evidence(rough: RoughSurface, smooth: Meshes, reported: RoughnessReport, height_m: float) -> dict[str, Any]:
    """Return what no other stage reads."""
    from pipeline.report.figures.roughness import draw_sections, draw_spectra  # Matplotlib takes 0.4 s to load

    return {
        "sections": draw_sections(rough, smooth, height_m),
        "amplitude": amplitude_table(rough),
        "roughness": reported,
        "spectra": draw_spectra(reported),
        "mesh_checks": check_rough(rough, closed_mesh(rough)[1]),
    }


_NO_ROCK: dict[str, Any] = {
    "smooth": {},
    "rough": {"none.txt": b"surface.overlay = none: no rough surface\n"},
    "texture": NO_PICTURE,
    "sections": NO_PICTURE,
    "amplitude": "",
    "roughness": None,
    "spectra": NO_PICTURE,
    "mesh_checks": None,
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
        "free_space": Artifact("contours/free_space.geojson", FreeSpace),
        "topology": Artifact("contours/topology.json", DriftNetwork),
        "extent": Artifact("compile3d/extent.json", SolidExtent),
        "volume": Artifact("compile3d/volume", Bundle),
        "solid": Artifact("survey/solid.npz", ClosedMesh),
    },
    writes={
        "smooth": Artifact("surface/smooth.npz", Meshes),
        "rough": Artifact("surface/rough", Bundle),
        "texture": Artifact("surface/texture.png", Image),
        "mesh_checks": Artifact("surface/mesh_checks.json", MeshReport | None),
        "roughness": Artifact("surface/roughness.json", RoughnessReport | None),
        "spectra": Artifact("surface/roughness.png", Image),
        "sections": Artifact("surface/sections.png", Image),
        "amplitude": Artifact("surface/amplitude.csv", str),
    },
)

if __name__ == "__main__":
    sys.exit(main(STAGE))
