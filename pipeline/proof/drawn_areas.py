"""Whether a world's record states the areas that its plan shows."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import ArtifactError
from pipeline.geometry.outline.binarize import left_out
from pipeline.types import Areas, Frame, Mask

_AREA_M2 = 1.1e-3  # areas have three decimals


def require_drawn_areas(path: Path, stated: Areas, walls_m: float, frame: Frame, cleaned: Mask, raw: Mask) -> None:
    """Compare the areas that only the plan gives: the tunnel before simplification, and unconnected pieces.

    Parameters
    ----------
    path : Path
        The file that states the areas, which the message names.
    stated : Areas
    walls_m : float
        Length of the workings' outline.
    frame : Frame
    cleaned, raw : (rows, cols) bool
        The workings, and all that is drawn.

    Raises
    ------
    ArtifactError
        If an area differs from the plan's by more than a pixel along the walls.
    """
    traced = float(cleaned.sum()) / frame.px_per_m**2
    unconnected = sum(piece[0] for piece in left_out(raw, cleaned, frame.px_per_m**2)) / frame.px_per_m**2
    rim_m2 = walls_m / frame.px_per_m
    if abs(stated.traced_tunnel_m2 - traced) > rim_m2 or abs(stated.unconnected_m2 - unconnected) > _AREA_M2:
        raise ArtifactError(
            f"{path}: areas: traced_tunnel_m2 = {stated.traced_tunnel_m2}, unconnected_m2 = "
            f"{stated.unconnected_m2}; the plan has {traced:.3f} and {unconnected:.3f}"
        )
