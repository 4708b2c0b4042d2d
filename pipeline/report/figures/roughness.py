"""Pictures of the rock: spectra of sources and built mesh, and cross-sections of both surfaces."""

from __future__ import annotations

import numpy as np
import trimesh
from matplotlib.axes import Axes

from pipeline.metrics.rock.roughness import SurfaceRoughness
from pipeline.report.figures.style import GREY, MOSS, OCHRE, ROCK, STEEL, new_figure, to_image
from pipeline.surface.mesh.rough import RoughSurface
from pipeline.surface.relief.spectrum import Bands, band_edges, band_wavelengths, fit_bands
from pipeline.surface.relief.spectrum import Roughness as TargetRoughness
from pipeline.surface.roughness_report import RoughnessReport
from pipeline.types import Image, Mesh

_COLOURS = {"published": OCHRE, "sweeps": STEEL, "cloud": MOSS}
_DEPTH_M = 4.0


def draw_spectra(report: RoughnessReport) -> Image:
    """Draw roughness over window and spectra over wavelength; lines are thick in the valid bands."""
    figure = new_figure(11, 4.6)
    rough, spectrum = figure.subplots(1, 2)
    for name, surfaces in report.sources.items():
        for surface, measured in surfaces.items():
            label = f"{name}, {surface}"
            style = "-" if surface == "wall" else "--"
            _roughness(rough, measured, label, _COLOURS[name], style)
            _spectrum(spectrum, measured, label, _COLOURS[name], style)
    for surface, style in (("wall", "-"), ("roof", "--"), ("section", ":")):
        _roughness(rough, report.built[surface], f"built, {surface}", ROCK, style)
        _spectrum(spectrum, report.built[surface], f"built, {surface}", ROCK, style)
    equivalent = _equivalent_bands(report.sources["published"]["wall"])
    spectrum.plot(
        equivalent.wavelength_m,
        _density(equivalent),
        "o-",
        color=OCHRE,
        ms=3,
        lw=1,
        label="published, as bands that fit its Rq",
    )
    spectrum.axvline(report.shortest_wavelength_m["wall"], color=GREY, lw=1, ls=":")
    spectrum.annotate(
        f" shortest wave built, {report.shortest_wavelength_m['wall']:.2f} m = "
        f"{report.shortest_wavelength_m['wall'] / report.spacing_m['wall']:.1f} x spacing",
        (report.shortest_wavelength_m["wall"], 0.03),
        xycoords=("data", "axes fraction"),
        fontsize=7,
        color=GREY,
    )
    for axes, x, y in (
        (rough, "window, m", "RMS residual, m"),
        (spectrum, "wavelength, m", "power spectral density, m$^3$"),
    ):
        axes.set(xscale="log", yscale="log", xlabel=x, ylabel=y)
        axes.legend(fontsize=7)
    rough.set_title("Roughness against window")
    spectrum.set_title("Spectra, thick where valid")
    return to_image(figure)


def _roughness(axes: Axes, measured: SurfaceRoughness, label: str, colour: str, style: str) -> None:
    kind = "line fit, median" if measured.line else "plane fit"
    axes.plot(measured.window_m, measured.rq_m, style, marker="o", ms=3, color=colour, label=f"{label} ({kind})")
    if measured.rq_p90_m and label.startswith("sweeps"):
        axes.fill_between(measured.window_m, measured.rq_m, measured.rq_p90_m, color=colour, alpha=0.15, lw=0)


def _spectrum(axes: Axes, measured: SurfaceRoughness, label: str, colour: str, style: str) -> None:
    if measured.spectrum is None:
        return
    wavelength, density = np.array(measured.spectrum.wavelength_m), np.array(measured.spectrum.psd_m3)
    low, high = measured.spectrum.valid_m
    valid = (wavelength >= low * 0.999) & (wavelength <= high * 1.001)
    axes.plot(wavelength, density, style, color=colour, lw=0.6)
    axes.plot(wavelength[valid], density[valid], style, color=colour, lw=2, label=label)


def _equivalent_bands(measured: SurfaceRoughness) -> Bands:
    targets = [TargetRoughness(w, rq) for w, rq in zip(measured.window_m, measured.rq_m, strict=True)]
    return fit_bands(targets, band_wavelengths(0.1, 4.0), 1.0)


def _density(bands: Bands) -> np.ndarray:
    edges = np.array([band_edges(float(w)) for w in bands.wavelength_m])
    return bands.sd_m**2 / (1 / edges[:, 0] - 1 / edges[:, 1])


def draw_sections(rough: RoughSurface, base: dict[str, Mesh], height_m: float) -> Image:
    """Draw three cross-sections of the workings: the smooth surface alone (top) and both surfaces (bottom)."""
    walls = rough.lattice.walls
    order = np.argsort(walls.passage_m, kind="stable")
    figure = new_figure(11, 5.2)
    rows = figure.subplots(2, 3, sharex=True, sharey=True)
    rock = trimesh.Trimesh(rough.mesh.vertices, rough.mesh.faces, process=False)
    for k, share in enumerate((0.15, 0.5, 0.9)):
        column = order[int(share * (len(order) - 1))]
        place, across = walls.xy[column], walls.inward[column]
        for row, layers in ((0, list(base.values())), (1, [*base.values(), rock])):
            axes: Axes = rows[row, k]
            for layer in layers:
                for line in _cut(layer, place, across, walls.passage_m[column]):
                    of_rock = layer is rock
                    axes.plot(line[:, 0], line[:, 1], color=ROCK if of_rock else STEEL, lw=1.2 if of_rock else 0.9)
            axes.set_aspect("equal")
            axes.set_ylim(-0.3, height_m + 0.6)
        rows[0, k].set_title(f"half width {walls.passage_m[column]:.1f} m, at ({place[0]:.0f}, {place[1]:.0f}) m")
        rows[1, k].set_xlabel("across, m")
    rows[0, 0].set_ylabel("smooth surface\nheight, m")
    rows[1, 0].set_ylabel("both surfaces\nheight, m")
    return to_image(figure)


def _cut(layer: Mesh | trimesh.Trimesh, place: np.ndarray, across: np.ndarray, half_m: float) -> list[np.ndarray]:
    """Return the section of a surface as lines (n, 2), m, across and up, in the vertical plane at a wall point."""
    middle = place + half_m * across
    near = np.linalg.norm(layer.vertices[:, :2] - middle, axis=1) < half_m + _DEPTH_M
    faces = layer.faces[near[layer.faces].any(axis=1)]
    along = np.array([-across[1], across[0], 0.0])
    segments = trimesh.intersections.mesh_plane(
        trimesh.Trimesh(layer.vertices, faces, process=False), along, np.array([*place, 0.0])
    )
    flat = np.stack([(segments[:, :, :2] - middle) @ across, segments[:, :, 2]], axis=-1)
    return [segment for segment in flat if np.abs(segment[:, 0]).max() < half_m + 1.0]
