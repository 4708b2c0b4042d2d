"""Stage 4: the visible rock."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from pipeline.params.base import DataFile, Params

Channel = Annotated[int, Field(ge=0, le=255)]


def _rising(limits: tuple[float, float]) -> tuple[float, float]:
    if not 0 <= limits[0] < limits[1]:
        raise ValueError("want 0 <= low < high")
    return limits


Interval = Annotated[tuple[float, float], AfterValidator(_rising)]
Lengths = Annotated[list[Annotated[float, Field(gt=0)]], Field(min_length=2)]
Deviations = Annotated[list[Annotated[float, Field(ge=0, le=1)]], Field(min_length=2)]


class LayersParams(Params):
    """The layers of a texture of rock; see `pipeline.surface.texture.layers.Layers`."""

    tint: float = Field(ge=0, le=1)
    grain: float = Field(ge=0, le=1)
    stain: float = Field(ge=0, le=1)
    streaks: float = Field(ge=0, le=1)
    dust: float = Field(ge=0, le=1)


class TextureParams(Params):
    """The colour texture of the rock, made of seeded noise."""

    size_px: int = Field(ge=16, le=4096)
    repeat_m: float = Field(gt=0)
    spectral_exponent: float = Field(ge=0, le=4)
    contrast: float = Field(ge=0, le=1)
    rgb: tuple[Channel, Channel, Channel]
    layers: LayersParams | None = Field(
        None, description="layers of rock; null: one noise by the exponent and contrast"
    )
    colours: int = Field(64, ge=4, le=256, description="of a texture in layers; fewer make a smaller file")
    tether_m: float | None = Field(
        None, ge=0.05, le=5, description="the texture follows the rock within about this; null: it stays on the plan"
    )
    seed: int = Field(ge=0)


class SweepsParams(Params):
    """Planar sweeps whose walls are measured. Without files, the stored measurement of the dataset is used."""

    files: dict[str, DataFile] = Field(description="name of a sweep -> file")
    measured: DataFile = Field(description="stored roughness of sweeps (written by `python -m pipeline roughness`)")
    max_range_m: float = Field(gt=0)
    max_range_var_m2: float = Field(gt=0)
    max_gap_m: float = Field(gt=0)
    window_m: float = Field(gt=0)
    footprint_m: float = Field(gt=0)


class CloudParams(Params):
    """A point cloud or scanned mesh of rock."""

    file: DataFile | None = None
    units: Literal["m", "mm", "ft"]
    thin_m: float = Field(ge=0.001, le=1)
    range_m: Interval
    height_m: Interval
    max_points: int = Field(ge=1000, le=100_000_000)
    mesh_points_per_m2: float = Field(gt=0)
    outlier_neighbours: int = Field(ge=2, le=200)
    outlier_ratio: float = Field(gt=0)
    window_m: float = Field(gt=0)


class SpectrumParams(Params):
    """The noise of the rock: s.d. of half-octave bands at wavelengths, interpolated linearly in the logarithms."""

    wavelength_m: Lengths
    wall_sd_m: Deviations
    roof_sd_m: Deviations

    @model_validator(mode="after")
    def _one_each(self) -> SpectrumParams:
        if not len(self.wavelength_m) == len(self.wall_sd_m) == len(self.roof_sd_m):
            raise ValueError("wavelength_m, wall_sd_m and roof_sd_m differ in length")
        if sorted(self.wavelength_m) != self.wavelength_m:
            raise ValueError("wavelength_m must rise")
        return self


class JointSetParams(Params):
    """A set of parallel joints."""

    dip_direction_deg: float = Field(ge=0, lt=360, description="clockwise from north")
    dip_deg: float = Field(ge=0, le=90, description="below the horizontal")
    spacing_m: float = Field(ge=0.05, le=20)


class FacesParams(Params):
    """The faces that blocks leave in a wall; see `pipeline.surface.relief.joints.Faces`."""

    step_m: float = Field(ge=0, le=0.5)
    stepped: float = Field(gt=0, le=1)
    slope: float = Field(ge=0, le=1)
    follow_deg: float = Field(ge=0, le=45)


class UndulationParams(Params):
    """Self-affine relief; see `pipeline.surface.relief.joints.Undulation`."""

    rms_m: float = Field(ge=0, le=0.5)
    hurst: float = Field(ge=0, le=1)
    shortest_m: float = Field(gt=0.1, le=20)
    longest_m: float = Field(gt=0.1, le=20)

    @model_validator(mode="after")
    def _shortest_first(self) -> UndulationParams:
        if self.shortest_m > self.longest_m:
            raise ValueError("shortest_m must not exceed longest_m")
        return self


class RockParams(Params):
    """Jointed rock; see `pipeline.surface.relief.joints.JointedRock`."""

    sets: list[JointSetParams] = Field(min_length=2, max_length=4, description="in the order of persistence")
    jitter: float = Field(ge=0, le=0.99)
    waviness_m: float = Field(ge=0, le=0.5)
    block: FacesParams
    overbreak: FacesParams
    overbreak_size: float = Field(gt=1, le=20)
    undulation: UndulationParams
    patch_m: float = Field(gt=0.5, le=100)
    patchiness: float = Field(ge=0, le=1.5)


class BoundsParams(Params):
    """Bounds on the displacement of the rock; see `pipeline.surface.mesh.displacement.Bounds`."""

    wall_m: float = Field(gt=0, le=1)
    roof_m: float = Field(gt=0, le=1)
    narrow_half_width_m: float = Field(gt=0)
    wide_half_width_m: float = Field(gt=0)
    narrow_share: float = Field(gt=0, lt=1)
    narrow_recess_m: float = Field(ge=0, le=0.3)
    narrow_gain: float = Field(ge=1, le=3)
    room_share: float = Field(gt=0, le=0.9)
    median_m: float = Field(gt=0, le=1)

    @model_validator(mode="after")
    def _narrow_below_wide(self) -> BoundsParams:
        if not self.narrow_half_width_m < self.wide_half_width_m:
            raise ValueError("narrow_half_width_m must be below wide_half_width_m")
        return self


class RoughParams(Params):
    """The rough surface: its mesh, noise and bounds."""

    spacing_m: float = Field(ge=0.02, le=0.5)
    roof_spacing_m: float = Field(ge=0.02, le=0.5)
    most_faces: int | None = Field(ge=10_000, description="above this both spacings are widened; null: no bound")
    arch_half_span_m: float = Field(gt=0)
    longest_wavelength_m: float = Field(gt=0.2, le=20)
    max_rms_m: float = Field(gt=0, le=0.5)
    modulation_m: float = Field(gt=0)
    modulation_spread: float = Field(ge=0, le=1)
    tile_m: float = Field(ge=2)
    kept_share: float | None = Field(
        None, gt=0.02, lt=1, description="share of the lattice's faces that the mesh keeps; null: all"
    )
    normals: bool = Field(False, description="write normals: chunks meet without a seam, a vertex costs 12 bytes more")
    crease_deg: float = Field(180, gt=0, le=180, description="faces that meet at a sharper angle share no normal")
    seed: int = Field(ge=0)
    bounds: BoundsParams


class SurfaceParams(Params):
    """The smooth surface, the rough surface, its reference rock, and the texture."""

    overlay: Literal["rough", "none"] = Field(
        "rough", description="visible rock over the collision parts; none: robots see the collision parts themselves"
    )
    floor_chamfer_m: float = Field(gt=0)
    roof_chamfer_m: float = Field(gt=0)
    texture: TextureParams
    reference: Literal["published", "sweeps", "cloud"]
    rock: RockParams | None = Field(None, description="jointed rock; null: noise with the spectrum of the reference")
    published: SpectrumParams
    sweeps: SweepsParams
    cloud: CloudParams
    rough: RoughParams

    @model_validator(mode="after")
    def _cloud_has_its_file(self) -> SurfaceParams:
        if self.reference == "cloud" and self.cloud.file is None:
            raise ValueError("surface.reference=cloud needs surface.cloud.file")
        return self
