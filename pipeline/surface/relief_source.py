"""Choose where the relief comes from: jointed rock, or noise with band spectra, as rough as the reference."""

from __future__ import annotations

import numpy as np

from pipeline.metrics.rock.roughness import SurfaceRoughness
from pipeline.params.surface import RockParams, RoughParams, SpectrumParams, SurfaceParams
from pipeline.surface.fit_rock import fit_rock
from pipeline.surface.mesh.displacement import Bounds
from pipeline.surface.mesh.lattice import Lattice
from pipeline.surface.reference import Sources
from pipeline.surface.relief.joints import Faces, JointedRock, JointSet, Undulation
from pipeline.surface.relief.spectrum import Bands, Roughness, band_edges, band_wavelengths, fit_bands

Relief = JointedRock | tuple[Bands, Bands]  # of noise: the spectra of walls and roof


def choose_relief(params: SurfaceParams, sources: Sources, lattice: Lattice) -> Relief:
    """Return the configured jointed rock, scaled until the lattice's walls are as rough as a measured reference.

    Without configured rock, return spectra for noise.
    """
    if params.rock is None:
        return choose_bands(params, sources)
    rock = configured_rock(params.rock)
    if params.reference == "published":  # the configured rock was fitted to it
        return rock
    return fit_rock(rock, sources[params.reference]["wall"], lattice, bounds_of(params.rough), params.rough.seed)


def bounds_of(params: RoughParams) -> Bounds:
    """Return the bounds on the displacement of the rock."""
    return Bounds(**params.bounds.model_dump())


def configured_rock(params: RockParams) -> JointedRock:
    """Return the configured jointed rock."""
    own = {"sets", "block", "overbreak", "undulation"}
    return JointedRock(
        sets=tuple(JointSet(**s.model_dump()) for s in params.sets),
        block=Faces(**params.block.model_dump()),
        overbreak=Faces(**params.overbreak.model_dump()),
        undulation=Undulation(**params.undulation.model_dump()),
        **params.model_dump(exclude=own),
    )


def choose_bands(params: SurfaceParams, sources: Sources) -> tuple[Bands, Bands]:
    """Return the spectra of walls and roof: the configured ones for the published scan, else a fit to measurements."""
    rough = params.rough
    shortest = 2 * min(rough.spacing_m, rough.roof_spacing_m)
    wavelength = band_wavelengths(shortest, rough.longest_wavelength_m)
    if params.reference == "published":
        wall, roof = (_interpolated(params.published, sd, wavelength) for sd in ("wall_sd_m", "roof_sd_m"))
    else:
        measured = sources[params.reference]
        wall = _fitted(measured["wall"], wavelength, rough.max_rms_m)
        roof = _fitted(measured["roof"], wavelength, rough.max_rms_m) if "roof" in measured else wall
    return _resolved_by(wall, rough.spacing_m), _resolved_by(roof, rough.roof_spacing_m)


def _interpolated(spectrum: SpectrumParams, name: str, wavelength: np.ndarray) -> Bands:
    given, sd = np.array(spectrum.wavelength_m), np.maximum(getattr(spectrum, name), 1e-9)
    interpolated = np.exp(np.interp(np.log(wavelength), np.log(given), np.log(sd)))
    # Below the shortest given wavelength, amplitude is proportional to wavelength, as for real rock.
    return Bands(wavelength, interpolated * np.minimum(1.0, wavelength / given[0]))


def _fitted(measured: SurfaceRoughness, wavelength: np.ndarray, max_rms_m: float) -> Bands:
    wanted = [
        Roughness(w, rq, line=measured.line, weight=4.0 if w == 0.5 else 1.0)
        for w, rq in zip(measured.window_m, measured.rq_m, strict=True)
        if w >= wavelength.min()  # a window shorter than every band does not constrain them
    ]
    return fit_bands(wanted, wavelength, max_rms_m)


def _resolved_by(bands: Bands, spacing_m: float) -> Bands:
    """Set bands to zero that hold waves shorter than two spacings of the mesh."""
    resolved = np.array([band_edges(w)[0] >= 2 * spacing_m * (1 - 1e-9) for w in bands.wavelength_m.tolist()])
    return Bands(bands.wavelength_m, np.where(resolved, bands.sd_m, 0.0))
