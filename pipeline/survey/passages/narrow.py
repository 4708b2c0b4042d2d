"""Cross-sections without an area."""

from __future__ import annotations

import numpy as np

LEAST_M = 0.05  # of a width or height: a section of no area makes no solid


def narrow_sections(stations: list[str], lrud: np.ndarray) -> list[str]:
    """Return a line for each section that has no area or is turned inside out."""
    sizes = np.column_stack([lrud[:, :2].sum(axis=1), lrud[:, 2:].sum(axis=1)])
    return [
        f"{station}: its {what} are {size:.2f} m apart, {LEAST_M:g} m are taken"
        for station, both in zip(stations, sizes.tolist(), strict=True)
        for what, size in zip(("walls", "roof and floor"), both, strict=True)
        if size < LEAST_M
    ]
