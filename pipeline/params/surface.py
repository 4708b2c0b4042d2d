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

    tint: float = Field(ge=0, le=1, description="strength of the variation of colour over metres, 0 to 1")
    grain: float = Field(ge=0, le=1, description="strength of minerals of a few millimetres, cracks and veins, 0 to 1")
    stain: float = Field(ge=0, le=1, description="strength of iron oxide stains, 0 to 1")
    streaks: float = Field(ge=0, le=1, description="strength of wet streaks down the walls, 0 to 1")
    dust: float = Field(ge=0, le=1, description="strength of dust over all other layers, 0 to 1")


class TextureParams(Params):
    """The colour texture of the rock, made of seeded noise."""

    size_px: int = Field(ge=16, le=4096, description="side of the square texture, px")
    repeat_m: float = Field(gt=0, description="length of rock that the texture covers once")
    spectral_exponent: float = Field(
        ge=0, le=4, description="of a texture of one noise: amplitude falls as frequency to minus this"
    )
    contrast: float = Field(
        ge=0, le=1, description="of a texture of one noise: s.d. of the brightness as a share of its mean"
    )
    rgb: tuple[Channel, Channel, Channel] = Field(description="mean colour of the rock, 0 to 255")
    layers: LayersParams | None = Field(
        None, description="layers of rock; null: one noise by the exponent and contrast"
    )
    colours: int = Field(
        64, ge=4, le=256, description="number of colours of a texture in layers; fewer make a smaller file"
    )
    tether_m: float | None = Field(
        None, ge=0.05, le=5, description="the texture follows the rock within about this; null: it stays on the plan"
    )
    scan_px: int = Field(
        2048, ge=256, le=4096, description="most px along a side of the picture of a scan with colours"
    )
    seed: int = Field(ge=0, description="seed of the texture")


class SweepsParams(Params):
    """Planar sweeps whose walls are measured. Without files, the stored measurement of the dataset is used."""

    files: dict[str, DataFile] = Field(description="name of a sweep -> file")
    measured: DataFile = Field(description="stored roughness of sweeps (written by `python -m pipeline roughness`)")
    max_range_m: float = Field(gt=0, description="longer returns are dropped")
    max_range_var_m2: float = Field(
        gt=0, description="returns with a larger variance of range are dropped: they straddle an edge"
    )
    max_gap_m: float = Field(gt=0, description="distance between neighbouring returns at which a wall ends")
    window_m: float = Field(gt=0, description="length of wall that a spectrum is measured over")
    footprint_m: float = Field(
        gt=0, description="size of the patch of wall that one return averages; shorter wavelengths are not trusted"
    )


class CloudParams(Params):
    """A point cloud or scanned mesh of rock."""

    file: DataFile | None = Field(
        None, description="point cloud or mesh below data/: .dat .xyz .txt .ply .pcd .las .laz .stl .obj"
    )
    units: Literal["m", "mm", "ft"] = Field(description="unit of the file's coordinates")
    thin_m: float = Field(ge=0.001, le=1, description="side of the voxels that keep one point each")
    range_m: Interval = Field(
        description="least and greatest distance of the points that are read from the file's origin"
    )
    height_m: Interval = Field(
        description="least and greatest height of the cloud; another height is refused, as units are then wrong"
    )
    max_points: int = Field(ge=1000, le=100_000_000, description="a cloud with more points after thinning is refused")
    mesh_points_per_m2: float = Field(gt=0, description="density at which a mesh is sampled")
    outlier_neighbours: int = Field(ge=2, le=200, description="nearest points whose mean distance shows an outlier")
    outlier_ratio: float = Field(
        gt=0, description="standard deviations above the mean of that distance at which a point is an outlier"
    )
    window_m: float = Field(
        gt=0, description="side of the voxels, and length of the strips in them, that roughness is measured in"
    )


class SpectrumParams(Params):
    """The noise of the rock: s.d. of half-octave bands at wavelengths, interpolated linearly in the logarithms."""

    wavelength_m: Lengths = Field(
        description="centres of the half-octave bands at which the noise of the published scan is given"
    )
    wall_sd_m: Deviations = Field(description="s.d. of the walls' noise in each band")
    roof_sd_m: Deviations = Field(description="s.d. of the roof's noise in each band")

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
    spacing_m: float = Field(ge=0.05, le=20, description="mean distance between the joints of the set")


class FacesParams(Params):
    """The faces that blocks leave in a wall; see `pipeline.surface.relief.joints.Faces`."""

    step_m: float = Field(ge=0, le=0.5, description="s.d. of the steps between faces, over all blocks")
    stepped: float = Field(gt=0, le=1, description="share of the blocks that are set back or stand out")
    slope: float = Field(ge=0, le=1, description="s.d. of the random slope of a face that follows no joint set")
    follow_deg: float = Field(
        ge=0, le=45, description="a face lies along a joint set that is at most this far from the wall"
    )


class UndulationParams(Params):
    """Self-affine relief; see `pipeline.surface.relief.joints.Undulation`."""

    rms_m: float = Field(ge=0, le=0.5, description="RMS height of the undulation of the rock")
    hurst: float = Field(ge=0, le=1, description="Hurst exponent of the undulation: 1 is smooth at small scale")
    shortest_m: float = Field(gt=0.1, le=20, description="shortest wavelength of the undulation")
    longest_m: float = Field(gt=0.1, le=20, description="longest wavelength of the undulation")

    @model_validator(mode="after")
    def _shortest_first(self) -> UndulationParams:
        if self.shortest_m > self.longest_m:
            raise ValueError("shortest_m must not exceed longest_m")
        return self


class RockParams(Params):
    """Jointed rock; see `pipeline.surface.relief.joints.JointedRock`."""

    sets: list[JointSetParams] = Field(
        min_length=2,
        max_length=4,
        description="two to four joint sets in the order of persistence: dip_direction_deg, dip_deg, spacing_m",
    )
    jitter: float = Field(
        ge=0, le=0.99, description="share of the spacing by which single joints lie off their even places"
    )
    waviness_m: float = Field(ge=0, le=0.5, description="RMS distance of a joint from a plane")
    block: FacesParams = Field(description="faces that single blocks leave")
    overbreak: FacesParams = Field(description="faces that overbreak leaves")
    overbreak_size: float = Field(gt=1, le=20, description="factor of the blocks' size where overbreak follows joints")
    undulation: UndulationParams = Field(description="self-affine relief under the blocks")
    patch_m: float = Field(gt=0.5, le=100, description="length over which roughness varies along a drift")
    patchiness: float = Field(ge=0, le=1.5, description="s.d. of the logarithm of the factor by which roughness varies")


class BoundsParams(Params):
    """Bounds on the displacement of the rock; see `pipeline.surface.mesh.displacement.Bounds`."""

    wall_m: float = Field(gt=0, le=1, description="greatest displacement of a wall, in wide passages")
    roof_m: float = Field(gt=0, le=1, description="greatest displacement of the roof")
    narrow_half_width_m: float = Field(gt=0, description="half width up to which a passage is narrow")
    wide_half_width_m: float = Field(gt=0, description="half width from which a passage is wide")
    narrow_share: float = Field(
        gt=0, lt=1, description="greatest displacement into a narrow passage, as a share of its half width"
    )
    narrow_recess_m: float = Field(
        ge=0, le=0.3, description="the walls of a narrow passage are first moved back by this"
    )
    narrow_gain: float = Field(
        ge=1, le=3, description="factor of the relief in a narrow passage, before the bound flattens it"
    )
    room_share: float = Field(
        gt=0,
        le=0.9,
        description="no wall moves by more than this share of the radius of the largest disc that touches it",
    )
    median_m: float = Field(
        gt=0, le=1, description="all displacements shrink if half of a wall at one height moves by more than this"
    )

    @model_validator(mode="after")
    def _narrow_below_wide(self) -> BoundsParams:
        if not self.narrow_half_width_m < self.wide_half_width_m:
            raise ValueError("narrow_half_width_m must be below wide_half_width_m")
        return self


class RoughParams(Params):
    """The rough surface: its mesh, noise and bounds."""

    spacing_m: float = Field(ge=0.02, le=0.5, description="distance between the rough surface's points on the walls")
    roof_spacing_m: float = Field(
        ge=0.02, le=0.5, description="distance between the rough surface's points on the roof"
    )
    thinnest_rock_m: float = Field(
        ge=0, le=0.6, description="thinnest rock between workings whose two sides bound each other's displacement"
    )
    most_faces: int | None = Field(ge=10_000, description="above this both spacings are widened; null: no bound")
    arch_half_span_m: float = Field(
        gt=0, description="the roof rises from the walls over this distance and is level beyond"
    )
    longest_wavelength_m: float = Field(
        gt=0.2, le=20, description="longest wavelength of noise that follows a reference"
    )
    max_rms_m: float = Field(gt=0, le=0.5, description="greatest RMS of the noise fitted to sweeps or a cloud")
    modulation_m: float = Field(gt=0, description="length over which the noise's roughness varies along a drift")
    modulation_spread: float = Field(
        ge=0, le=1, description="s.d. of the logarithm of the factor by which the noise's roughness varies"
    )
    tile_m: float = Field(ge=2, description="side of the chunks that the rough surface is cut into")
    kept_share: float | None = Field(
        None, gt=0.02, lt=1, description="share of the lattice's faces that the mesh keeps; null: all"
    )
    normals: bool = Field(False, description="write normals: chunks meet without a seam, a vertex costs 12 bytes more")
    crease_deg: float = Field(180, gt=0, le=180, description="faces that meet at a sharper angle share no normal")
    seed: int = Field(ge=0, description="seed of the rock's relief")
    bounds: BoundsParams = Field(description="bounds on the displacement of the rock")


class SurfaceParams(Params):
    """The smooth surface, the rough surface, its reference rock, and the texture."""

    overlay: Literal["rough", "none"] = Field(
        "rough", description="visible rock over the collision parts; none: robots see the collision parts themselves"
    )
    floor_chamfer_m: float = Field(gt=0, description="width and height of the chamfer between wall and floor")
    roof_chamfer_m: float = Field(
        gt=0, description="width and height of the chamfer between wall and roof; the visible roof arches over it"
    )
    texture: TextureParams = Field(description="colour texture of the rock")
    reference: Literal["published", "sweeps", "cloud"] = Field(
        description="the rock whose roughness is copied: the paper's published scan, sweeps or a cloud"
    )
    rock: RockParams | None = Field(None, description="jointed rock; null: noise with the spectrum of the reference")
    published: SpectrumParams = Field(
        description="noise with the spectrum of the published scan, for a world without jointed rock"
    )
    sweeps: SweepsParams = Field(description="planar sweeps with reference=sweeps")
    cloud: CloudParams = Field(description="point cloud or mesh with reference=cloud")
    rough: RoughParams = Field(description="mesh, noise and bounds of the rough surface")

    @model_validator(mode="after")
    def _cloud_has_its_file(self) -> SurfaceParams:
        if self.reference == "cloud" and self.cloud.file is None:
            raise ValueError("surface.reference=cloud needs surface.cloud.file")
        return self
