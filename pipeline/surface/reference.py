"""Measure the rock that the rough surface copies: the published figures, real sweeps, or a point cloud."""

from __future__ import annotations

from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from minesurveys.refusals import first_refusal
from minesurveys.remarks import warn_user
from pipeline.errors import InputError
from pipeline.metrics.rock.roughness import (
    SurfaceRoughness,
    published_roughness,
    roughness_of_cloud,
    roughness_of_sweeps,
)
from pipeline.params.surface import CloudParams, SurfaceParams, SweepsParams
from pipeline.scans.cloud import CloudLimits, read_cloud, split_surfaces, without_outliers
from pipeline.scans.sweeps import read_sweep

Sources = dict[str, dict[str, SurfaceRoughness]]  # source -> surface (wall, roof) -> its roughness


def reference_files(params: SurfaceParams) -> list[str]:
    """List the registered files that stage 4 reads."""
    cloud = [params.cloud.file] if params.cloud.file else []
    return [*params.sweeps.files.values(), params.sweeps.measured, *cloud]


def measure_sources(params: SurfaceParams) -> Sources:
    """Return the roughness of every source: the published figures, the sweeps, and the cloud if one is configured."""
    sources: Sources = {"published": {"wall": published_roughness()}, "sweeps": {"wall": measure_sweeps(params.sweeps)}}
    if params.cloud.file:
        sources["cloud"] = measure_cloud(params.cloud)
    return sources


def measure_sweeps(params: SweepsParams) -> SurfaceRoughness:
    """Measure the configured sweeps, or read an earlier measurement if there are none."""
    if not params.files:
        path = Path(params.measured)
        try:
            return TypeAdapter(SurfaceRoughness).validate_json(path.read_bytes())
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from error
        except ValidationError as error:
            raise InputError(f"{path}: not the roughness of sweeps ({first_refusal(error)})") from error
    sweeps = {
        name: read_sweep(Path(file), params.max_range_m, params.max_range_var_m2) for name, file in params.files.items()
    }
    return roughness_of_sweeps(sweeps, params.max_gap_m, params.window_m, params.footprint_m)


def measure_cloud(params: CloudParams) -> dict[str, SurfaceRoughness]:
    """Read, clean and split a cloud; measure its walls and, if it has enough points there, its roof."""
    assert params.file is not None
    limits = CloudLimits(params.thin_m, params.range_m, params.max_points, params.height_m, params.mesh_points_per_m2)
    points = read_cloud(Path(params.file), params.units, limits)
    parts = split_surfaces(without_outliers(points, params.outlier_neighbours, params.outlier_ratio))
    footprint = 2 * params.thin_m
    measured = {"wall": roughness_of_cloud(parts["wall"], params.window_m, footprint, f"{params.file}: the walls")}
    try:
        measured["roof"] = roughness_of_cloud(parts["roof"], params.window_m, footprint, f"{params.file}: the roof")
    except InputError as error:
        warn_user(f"{error}; the roof copies the walls", of="surface")
    return measured
