"""The six texture axes, which a report of the paper gives."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TextureAxes:
    """The six axes of the texture report in the paper; None where the surface gives no figure."""

    wall_jaggedness_deg: float | None
    bump_rq_m: float | None
    roughness_integral_m2: float | None
    dominant_wavelength_m: float | None
    roof_irregularity_m: float | None
    wall_heterogeneity_m: float | None
