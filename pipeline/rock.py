"""Stage 4's work: measure the rock to be copied, choose its noise, build the overlay and say what came of it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError
from shapely import Polygon

from pipeline.errors import InputError
from pipeline.geometry.displacement import Bounds
from pipeline.geometry.lattice import BACK, WALL, BoreProfile, lay_lattice
from pipeline.geometry.overlay import Modulation, Overlay, cut_chunks, displace_lattice
from pipeline.geometry.spectrum import Bands, Roughness, band_edges, band_wavelengths, fit_bands
from pipeline.geometry.walls import lay_walls
from pipeline.metrics.roughness import SurfaceRoughness, published_roughness, roughness_of_cloud, roughness_of_sweeps
from pipeline.metrics.sampling import faces_near, sample_triangles
from pipeline.params.surface import CloudParams, OverlayParams, SpectrumParams, SurfaceParams, SweepsParams
from pipeline.store.codecs import Bundle, encode
from pipeline.survey.cloud import CloudLimits, read_cloud, split_surfaces, without_outliers
from pipeline.survey.poses import read_sweep
from pipeline.types import DriftNetwork

Sources = dict[str, dict[str, SurfaceRoughness]]  # source -> surface (wall, back) -> its roughness

_STRETCHES, _STRETCH_M, _POINTS = 6, 8.0, 250_000
_BUILT_WINDOW_M = 2.0
_SECTION_M = 0.5  # a robot's LiDAR looks about this high
_SECTION_STEP_M = 0.025
_TABLE_STEP_M = 5.0
_WIDEST_M = 0.5


@dataclass(frozen=True)
class RoughnessReport:
    """What the overlay copies and what was built; `built` has `wall`, `back`, and `section` at robot height."""

    reference: str
    sources: Sources
    wavelength_m: list[float]
    wall_sd_m: list[float]
    back_sd_m: list[float]
    shortest_wavelength_m: dict[str, float]
    spacing_m: dict[str, float]
    built: dict[str, SurfaceRoughness]
    amplitude: dict[str, float]


def rock_sources(params: SurfaceParams) -> list[str]:
    """List the registered files that stage 4 reads."""
    cloud = [params.cloud.file] if params.cloud.file else []
    return [*params.sweeps.files.values(), params.sweeps.measured, *cloud]


def measure_sources(params: SurfaceParams) -> Sources:
    """Measure every source there is: the published figures, the sweeps, and the cloud if one is named."""
    sources: Sources = {"published": {"wall": published_roughness()}, "sweeps": {"wall": measure_sweeps(params.sweeps)}}
    if params.cloud.file:
        sources["cloud"] = measure_cloud(params.cloud)
    return sources


def measure_sweeps(params: SweepsParams) -> SurfaceRoughness:
    """Measure the sweeps that are named, or read the figures of the ones measured before."""
    if not params.files:
        path = Path(params.measured)
        try:
            return TypeAdapter(SurfaceRoughness).validate_json(path.read_bytes())
        except (OSError, ValidationError) as error:
            raise InputError(f"{path}: not the roughness of sweeps ({str(error).splitlines()[0]})") from error
    sweeps = {
        name: read_sweep(Path(file), params.max_range_m, params.max_range_var_m2) for name, file in params.files.items()
    }
    return roughness_of_sweeps(sweeps, params.max_gap_m, params.window_m, params.footprint_m)


def measure_cloud(params: CloudParams) -> dict[str, SurfaceRoughness]:
    """Read, clean and split a cloud, and measure its walls and, where it shows enough of it, its back."""
    assert params.file is not None
    limits = CloudLimits(params.thin_m, params.range_m, params.max_points, params.height_m, params.mesh_points_per_m2)
    points = read_cloud(Path(params.file), params.units, limits)
    parts = split_surfaces(without_outliers(points, params.outlier_neighbours, params.outlier_ratio))
    footprint = 2 * params.thin_m
    measured = {"wall": roughness_of_cloud(parts["wall"], params.window_m, footprint, f"{params.file}: the walls")}
    try:
        measured["back"] = roughness_of_cloud(parts["back"], params.window_m, footprint, f"{params.file}: the back")
    except InputError as error:
        print(f"surface: {error}; the back copies the walls")
    return measured


def choose_bands(params: SurfaceParams, sources: Sources) -> tuple[Bands, Bands]:
    """Return the noise of walls and back: the published reference's as found by search, or a fit to measurements."""
    overlay = params.overlay
    shortest = 2 * min(overlay.spacing_m, overlay.back_spacing_m)
    wavelength = band_wavelengths(shortest, overlay.longest_wavelength_m)
    if params.reference == "published":
        wall, back = (_interpolated(params.published, sd, wavelength) for sd in ("wall_sd_m", "back_sd_m"))
    else:
        measured = sources[params.reference]
        wall = _fitted(measured["wall"], wavelength, overlay.max_rms_m)
        back = _fitted(measured["back"], wavelength, overlay.max_rms_m) if "back" in measured else wall
    return _held_by(wall, overlay.spacing_m), _held_by(back, overlay.back_spacing_m)


def _interpolated(spectrum: SpectrumParams, name: str, wavelength: np.ndarray) -> Bands:
    known, sd = np.array(spectrum.wavelength_m), np.maximum(getattr(spectrum, name), 1e-9)
    found = np.exp(np.interp(np.log(wavelength), np.log(known), np.log(sd)))
    # Below the shortest wavelength that was fitted, amplitude falls with wavelength, as real rock's does there.
    return Bands(wavelength, found * np.minimum(1.0, wavelength / known[0]))


def _fitted(measured: SurfaceRoughness, wavelength: np.ndarray, max_rms_m: float) -> Bands:
    wanted = [
        Roughness(w, rq, line=measured.line, weight=4.0 if w == 0.5 else 1.0)
        for w, rq in zip(measured.window_m, measured.rq_m, strict=True)
        if w >= wavelength.min()  # a window shorter than every band says nothing of them
    ]
    return fit_bands(wanted, wavelength, max_rms_m)


def _held_by(bands: Bands, spacing_m: float) -> Bands:
    """Silence the bands with waves shorter than two spacings of the mesh."""
    held = np.array([band_edges(w)[0] >= 2 * spacing_m * (1 - 1e-9) for w in bands.wavelength_m.tolist()])
    return Bands(bands.wavelength_m, np.where(held, bands.sd_m, 0.0))


def widen_spacing(params: SurfaceParams, free: Polygon, height_m: float) -> SurfaceParams:
    """Return the parameters with both spacings widened until the overlay has no more than `most_faces`; it is said.

    Raises
    ------
    InputError
        If that takes spacings beyond 0.5 m.
    """
    look = params.overlay
    profile = BoreProfile(height_m, params.sill_chamfer_m, params.back_chamfer_m, look.arch_half_span_m)
    wall_m2 = free.length * (height_m - profile.arch_rise_m)
    faces = 2 * wall_m2 / look.spacing_m**2 + 2 * free.area / look.back_spacing_m**2
    if look.most_faces is None or faces <= look.most_faces:
        return params
    wider = math.sqrt(faces / look.most_faces)
    spacing, back = (round(wider * s, 3) for s in (look.spacing_m, look.back_spacing_m))
    need = f"{free.area:.0f} m2 of workings would need {faces / 1e6:.1f} million faces of rock"
    if max(spacing, back) > _WIDEST_M:
        raise InputError(f"surface: {need}, surface.overlay.most_faces is {look.most_faces}; build a part of the mine")
    print(
        f"surface: {need}; points are laid {spacing:g} m apart instead of {look.spacing_m:g} m, "
        "too wide for the limits on texture (surface.overlay.most_faces)"
    )
    return params.model_copy(update={"overlay": look.model_copy(update={"spacing_m": spacing, "back_spacing_m": back})})


def build_rock(
    params: SurfaceParams, free: Polygon, network: DriftNetwork | None, height_m: float, noise: tuple[Bands, Bands]
) -> Overlay:
    """Build the overlay from the noise of walls and back.

    Raises
    ------
    GeometryError
        If the mesh cannot be laid, or cuts itself beyond mending.
    """
    look = params.overlay
    profile = BoreProfile(height_m, params.sill_chamfer_m, params.back_chamfer_m, look.arch_half_span_m)
    lattice = lay_lattice(lay_walls(free, look.spacing_m, network), profile, look.spacing_m, look.back_spacing_m)
    return displace_lattice(
        lattice, *noise, Modulation(look.modulation_m, look.modulation_spread), Bounds(**look.bounds.model_dump()),
        np.random.default_rng(look.seed),
    )  # fmt: skip


def report_rock(
    params: SurfaceParams, sources: Sources, noise: tuple[Bands, Bands], overlay: Overlay
) -> RoughnessReport:
    """Measure an overlay and say what it was built from."""
    look, (wall, back) = params.overlay, noise
    return RoughnessReport(
        reference=params.reference,
        sources=sources,
        wavelength_m=wall.wavelength_m.round(5).tolist(),
        wall_sd_m=wall.sd_m.round(5).tolist(),
        back_sd_m=back.sd_m.round(5).tolist(),
        shortest_wavelength_m={"wall": _shortest(wall), "back": _shortest(back)},
        spacing_m={"wall": look.spacing_m, "back": look.back_spacing_m},
        built=measure_built(overlay, look),
        amplitude=_amplitude(overlay),
    )


def _shortest(bands: Bands) -> float:
    return round(band_edges(float(bands.wavelength_m[bands.sd_m > 0].min()))[0], 4)


def measure_built(overlay: Overlay, look: OverlayParams) -> dict[str, SurfaceRoughness]:
    """Measure the overlay by its own faces: walls and back as clouds, the walls' section as a sweep."""
    lattice, rng = overlay.lattice, np.random.default_rng(look.seed)
    places = lattice.walls.xy[np.linspace(0, len(lattice.walls.xy) - 1, _STRETCHES, dtype=int)]
    built = {}
    for piece, name, spacing in ((WALL, "wall", look.spacing_m), (BACK, "back", look.back_spacing_m)):
        corners = faces_near(overlay.vertices[lattice.faces[lattice.piece == piece]], places, _STRETCH_M)
        points, _ = sample_triangles(corners, _POINTS, rng)
        built[name] = roughness_of_cloud(points, _BUILT_WINDOW_M, 2 * spacing, f"the overlay's {name}")
    rings = _section(overlay)
    built["section"] = roughness_of_sweeps(rings, 1.0, 2 * _BUILT_WINDOW_M, 2 * look.spacing_m)
    return built


def _section(overlay: Overlay) -> dict[str, np.ndarray]:
    """Return the walls' line at robot height, ring by ring, as dense points (n, 2) m."""
    lattice = overlay.lattice
    columns = len(lattice.walls.xy)
    levels = overlay.vertices[: lattice.wall_vertices : columns, 2]
    row = int(np.abs(levels - _SECTION_M).argmin())
    line = overlay.vertices[row * columns : (row + 1) * columns, :2]
    dense = {}
    for i, ring in enumerate(lattice.walls.rings):
        part = line[ring.first : ring.first + ring.count]
        at = np.arange(0, ring.count - 1, _SECTION_STEP_M / ring.step_m)
        dense[f"ring {i}"] = np.column_stack([np.interp(at, np.arange(ring.count), part[:, k]) for k in (0, 1)])
    return dense


def _amplitude(overlay: Overlay) -> dict[str, float]:
    on_back = overlay.lattice.back_share > 0.5
    on_wall = overlay.lattice.back_share == 0
    figures = {}
    for name, of in (("wall", on_wall), ("back", on_back)):
        figures[f"{name}_wanted_rms_m"] = round(float(np.sqrt((overlay.wanted_m[of] ** 2).mean())), 4)
        figures[f"{name}_given_rms_m"] = round(float(np.sqrt((overlay.given_m[of] ** 2).mean())), 4)
    return figures | {"mended_places": len(overlay.mended)}


def amplitude_table(overlay: Overlay) -> str:
    """Return CSV: along each wall, the half width, the RMS displacement wanted and given, and the share kept."""
    lattice = overlay.lattice
    columns = len(lattice.walls.xy)
    wanted, given = (
        (d[: lattice.wall_vertices] ** 2).reshape(lattice.rows, columns).mean(axis=0)
        for d in (overlay.wanted_m, overlay.given_m)
    )
    lines = ["ring,along_m,easting_m,northing_m,half_width_m,wanted_rms_m,given_rms_m,kept"]
    for i, ring in enumerate(lattice.walls.rings):
        step = max(1, round(_TABLE_STEP_M / ring.step_m))
        for at in range(0, ring.count, step):
            part = slice(ring.first + at, ring.first + min(at + step, ring.count))
            (x, y), half = lattice.walls.xy[ring.first + at], lattice.walls.passage_m[part].mean()
            asked, got = np.sqrt(wanted[part].mean()), np.sqrt(given[part].mean())
            lines.append(
                f"{i},{at * ring.step_m:.1f},{x:.2f},{y:.2f},{half:.2f},{asked:.4f},{got:.4f},"
                f"{got / max(asked, 1e-9):.3f}"
            )
    return "\n".join(lines) + "\n"


def chunk_files(overlay: Overlay, tile_m: float, texture_m: float) -> Bundle:
    """Return the overlay's chunks as `NAME.msh`."""
    return {f"{k}.msh": encode(Path(f"{k}.msh"), mesh) for k, mesh in cut_chunks(overlay, tile_m, texture_m).items()}


def roughness_json(measured: SurfaceRoughness) -> dict[str, Any]:
    """Return the figures as plain JSON values."""
    return json.loads(TypeAdapter(SurfaceRoughness).dump_json(measured))
