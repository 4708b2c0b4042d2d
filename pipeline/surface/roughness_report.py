"""Measure the built rough surface: its roughness, and the displacement that the bounds left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.metrics.rock.roughness import SurfaceRoughness, roughness_of_cloud, roughness_of_sweeps
from pipeline.metrics.rock.sampling import faces_near, sample_triangles
from pipeline.params.surface import RoughParams, SurfaceParams
from pipeline.surface.mesh.lattice import ROOF, WALL
from pipeline.surface.mesh.rough import RoughSurface
from pipeline.surface.reference import Sources
from pipeline.surface.relief.joints import Gains, JointedRock
from pipeline.surface.relief.spectrum import band_edges
from pipeline.surface.relief_source import Relief

_STRETCHES, _STRETCH_M, _POINTS = 6, 8.0, 250_000
_BUILT_WINDOW_M = 2.0
_SECTION_M = 0.5  # about the height of a robot's LiDAR
_SECTION_STEP_M = 0.025
_TABLE_STEP_M = 5.0


@dataclass(frozen=True)
class RoughnessReport:
    """The reference, what the relief was made of, and the built roughness.

    Noise has spectra, jointed rock has `gains`. `built` has `wall`, `roof`, and `section` at robot height.
    """

    reference: str
    sources: Sources
    wavelength_m: list[float]
    wall_sd_m: list[float]
    roof_sd_m: list[float]
    gains: Gains | None
    shortest_wavelength_m: dict[str, float]
    spacing_m: dict[str, float]
    built: dict[str, SurfaceRoughness]
    amplitude: dict[str, float]


def report_roughness(params: SurfaceParams, sources: Sources, relief: Relief, rough: RoughSurface) -> RoughnessReport:
    """Measure the rough surface and record the reference and the relief that it was built from."""
    spacing = {"wall": params.rough.spacing_m, "roof": params.rough.roof_spacing_m}
    if isinstance(relief, JointedRock):
        wavelength: list[float] = []
        sd: dict[str, list[float]] = {"wall": [], "roof": []}
        shortest = {name: round(2 * apart, 4) for name, apart in spacing.items()}
    else:
        bands = dict(zip(("wall", "roof"), relief, strict=True))
        wavelength = relief[0].wavelength_m.round(5).tolist()
        sd = {name: spectrum.sd_m.round(5).tolist() for name, spectrum in bands.items()}
        finest = {name: float(s.wavelength_m[s.sd_m > 0].min()) for name, s in bands.items()}
        shortest = {name: round(band_edges(wave)[0], 4) for name, wave in finest.items()}
    return RoughnessReport(
        reference=params.reference,
        sources=sources,
        wavelength_m=wavelength,
        wall_sd_m=sd["wall"],
        roof_sd_m=sd["roof"],
        gains=relief.gains if isinstance(relief, JointedRock) else None,
        shortest_wavelength_m=shortest,
        spacing_m=spacing,
        built=measure_built(rough, params.rough),
        amplitude=_amplitude(rough),
    )


def measure_built(rough: RoughSurface, params: RoughParams) -> dict[str, SurfaceRoughness]:
    """Measure the faces of the rough surface: walls and roof as point clouds, a section of the walls as a sweep."""
    lattice, mesh, rng = rough.lattice, rough.mesh, np.random.default_rng(params.seed)
    places = lattice.walls.xy[np.linspace(0, len(lattice.walls.xy) - 1, _STRETCHES, dtype=int)]
    built = {}
    for piece, name, spacing in ((WALL, "wall", params.spacing_m), (ROOF, "roof", params.roof_spacing_m)):
        triangles = faces_near(mesh.vertices[mesh.faces[mesh.piece == piece]], places, _STRETCH_M)
        points, _ = sample_triangles(triangles, _POINTS, rng)
        built[name] = roughness_of_cloud(points, _BUILT_WINDOW_M, 2 * spacing, f"the rough surface's {name}")
    rings = wall_section(rough)
    built["section"] = roughness_of_sweeps(rings, 1.0, 2 * _BUILT_WINDOW_M, 2 * params.spacing_m)
    return built


def wall_section(rough: RoughSurface) -> dict[str, np.ndarray]:
    """Return the walls' line at robot height as dense points (n, 2) m for each ring."""
    lattice = rough.lattice
    columns = len(lattice.walls.xy)
    levels = rough.vertices[: lattice.wall_vertices : columns, 2]
    row = int(np.abs(levels - _SECTION_M).argmin())
    line = rough.vertices[row * columns : (row + 1) * columns, :2]
    dense = {}
    for i, ring in enumerate(lattice.walls.rings):
        part = line[ring.first : ring.first + ring.count]
        at = np.arange(0, ring.count - 1, _SECTION_STEP_M / ring.step_m)
        dense[f"ring {i}"] = np.column_stack([np.interp(at, np.arange(ring.count), part[:, k]) for k in (0, 1)])
    return dense


def _amplitude(rough: RoughSurface) -> dict[str, float]:
    on_roof = rough.lattice.roof_share > 0.5
    on_wall = rough.lattice.roof_share == 0
    figures = {}
    for name, mask in (("wall", on_wall), ("roof", on_roof)):
        figures[f"{name}_wanted_rms_m"] = round(float(np.sqrt((rough.wanted_m[mask] ** 2).mean())), 4)
        figures[f"{name}_given_rms_m"] = round(float(np.sqrt((rough.given_m[mask] ** 2).mean())), 4)
    return figures | {"mended_places": len(rough.mended)}


def amplitude_table(rough: RoughSurface) -> str:
    """Return CSV along each wall: half width, RMS displacement before and after the bounds, and the share kept."""
    lattice = rough.lattice
    columns = len(lattice.walls.xy)
    wanted, given = (
        (d[: lattice.wall_vertices] ** 2).reshape(lattice.rows, columns).mean(axis=0)
        for d in (rough.wanted_m, rough.given_m)
    )
    lines = ["ring,along_m,easting_m,northing_m,half_width_m,wanted_rms_m,given_rms_m,kept"]
    for i, ring in enumerate(lattice.walls.rings):
        step = max(1, round(_TABLE_STEP_M / ring.step_m))
        for at in range(0, ring.count, step):
            part = slice(ring.first + at, ring.first + min(at + step, ring.count))
            (x, y), half = lattice.walls.xy[ring.first + at], lattice.walls.passage_m[part].mean()
            before, after = np.sqrt(wanted[part].mean()), np.sqrt(given[part].mean())
            lines.append(
                f"{i},{at * ring.step_m:.1f},{x:.2f},{y:.2f},{half:.2f},{before:.4f},{after:.4f},"
                f"{after / max(before, 1e-9):.3f}"
            )
    return "\n".join(lines) + "\n"
