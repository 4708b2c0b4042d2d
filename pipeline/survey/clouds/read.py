"""Read a scan as the solid of its free space, with what was left out, closed and not seen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import manifold3d
import numpy as np
from shapely import MultiPolygon

from minesurveys.errors import InputError, first_few
from minesurveys.frames import METRES, Georeference
from minesurveys.remarks import warn_user
from pipeline.params.survey import CloudSurveyParams
from pipeline.survey.clouds.points import ScanFile, ScanPoints, read_points, turned
from pipeline.survey.clouds.thinned import ThinnedCloud
from pipeline.survey.clouds.trajectory import Trajectory, read_trajectory
from pipeline.survey.clouds.volume import NOWHERE, ScannedVolume, volume_of_cloud
from pipeline.survey.solids.read import MOST_FACETS, view_from_above, warn_of_crossed
from pipeline.types import ClosedMesh

_LEAST_OTHER_M3 = 20.0  # the inside of a vehicle is no space of its own


@dataclass(frozen=True)
class ScanReading:
    """The free space of a scan (m, mine frame), its view from above, where the frame lies, and how it was found."""

    solid: ClosedMesh
    workings: MultiPolygon
    georeference: Georeference
    volume: ScannedVolume


def thinned_scan(params: CloudSurveyParams, thin_m: float, look: bool = False) -> ScanPoints:
    """Read the points of a scan, thinned to voxels of `thin_m`.

    A `look` at a large scan has larger ones. With a trajectory the points have their times, where the file states them.
    """
    timed, colours = params.trajectory is not None and not look, params.colours and not look
    metres, up = None if params.unit is None else METRES[params.unit], params.up or "z"
    return read_points(ScanFile(params.file, metres, up, params.origin, thin_m, look, timed, colours))


def read_scan(params: CloudSurveyParams) -> ScanReading:
    """Read a scan, and find the free space that its points bound. Warnings list what was left out and closed.

    Raises
    ------
    InputError
        If the file cannot be read, or its points enclose no space. The message names the file and the option.
    """
    scan = thinned_scan(params, params.voxel_m / 2)
    cloud, origin, metres = scan.cloud, scan.origin, scan.axes.unit_m
    way, seen_from = NOWHERE, NOWHERE
    if params.trajectory is not None:
        read = read_trajectory(Path(params.trajectory))
        places = turned(scan.axes.of(read.places), params.up or "z")
        trajectory = Trajectory(read.time_s, (places - origin) * metres)
        way, seen_from = trajectory.places, _places_of(cloud, trajectory, params)
    try:
        found = volume_of_cloud(cloud, params.voxel_m, params.simplify_m, MOST_FACETS, way, seen_from)
    except InputError as error:
        raise InputError(f"{params.file}: {error}") from error
    # The frame's height 0 is a whole metre below the lowest floor.
    down = float(np.floor(found.vertices[:, 2].min()))
    lift = np.array([0, 0, down])
    _warn(Path(params.file), found, params, down)
    solid = ClosedMesh(
        found.vertices - lift,
        found.faces.astype(np.int32),
        origin[2] * metres + down,
        found.bounding.points_m - lift,
        found.bounding.rgb,
        found.rays_m - lift,
    )
    place = Georeference(params.unit or scan.axes.unit, metres, (origin[0], origin[1]), scan.axes.crs)
    manifold = manifold3d.Manifold(manifold3d.Mesh64(found.vertices, found.faces.astype(np.uint64)))
    return ScanReading(solid, view_from_above(manifold), place, found)


def _places_of(cloud: ThinnedCloud, trajectory: Trajectory, params: CloudSurveyParams) -> np.ndarray:
    """Return the place (n, 3) m of the scanner at each point's time, NaN beyond its trajectory; none without times.

    Raises
    ------
    InputError
        If no point has a time of the trajectory's: their clocks differ.
    """
    times = cloud.time_s[np.isfinite(cloud.time_s)]
    if not len(times) or not trajectory.has_clock:
        return NOWHERE
    places = trajectory.at(cloud.time_s)
    if np.isnan(places).all():
        of_points, of_way = (f"{t.min():.3f} to {t.max():.3f} s" for t in (times, trajectory.time_s))
        raise InputError(
            f"{params.file}: its points' times, {of_points}, are not those of {params.trajectory}, {of_way}: the "
            "clocks differ; state one clock in both, or time 0 in every row of the trajectory, which gives places alone"
        )
    return places


def _place(middle_m: tuple[float, float, float], down: float) -> str:
    x, y, z = middle_m
    return f"({x:.1f}, {y:.1f}, {z - down:.1f})"


def _warn(path: Path, found: ScannedVolume, params: CloudSurveyParams, down: float) -> None:
    """Warn of what was left out, closed and not seen, with places in the mine frame."""
    name = path.name
    warn_of_crossed(path, found.apart)
    if len(found.bounding.rgb):
        warn_user("the visible rock has the colours of the points (survey.colours)", of=name, option="survey.colours")
    if found.moved_m > params.simplify_m:
        warn_user(
            f"of its surface, simplified to {len(found.faces):,} triangles, four fifths move by at most "
            f"{found.moved_m:.2g} m; {params.simplify_m:g} m (--simplify M) would take more triangles "
            "than a world has",
            of=name,
            option="--simplify",
        )
    for side in found.missing:
        warn_user(f"{side}; the surface there is a guess", of=name)
    if found.things:
        listed = [
            f"{a:.1f} x {b:.1f} x {c:.1f} m at {_place(thing.middle_m, down)}"
            for thing in found.things
            for a, b, c in [thing.size_m]
        ]
        warn_user(f"things stand free and are left out: {first_few(listed)}", of=name, count=len(found.things))
    if found.strays:
        warn_user("voxels with points stand apart in the air, and are left out", of=name, count=found.strays)
    thin = len(found.thin_points_m)
    if thin:
        warn_user(
            "voxels with points have free space on both sides, as ropes have, and are left out", of=name, count=thin
        )
    if len(found.beyond_m):
        warn_user("voxels with points lie behind the walls, and bound nothing", of=name, count=len(found.beyond_m))
    for what, gaps in (
        (
            f"holes of the scan, at most {params.close_m:g} m wide (--close M), are closed",
            [gap for gap in found.gaps if gap.width_m <= params.close_m],
        ),
        (
            f"places more than {params.close_m:g} m wide (--close M) were not seen: shadows, or where the scan ends",
            [gap for gap in found.gaps if gap.width_m > params.close_m],
        ),
    ):
        if gaps:
            listed = [f"{gap.width_m:.1f} m at {_place(gap.middle_m, down)}" for gap in gaps]
            warn_user(f"{what}: {first_few(listed)}", of=name, count=len(gaps))
    if found.unseen:
        sample = found.unseen + len(found.rays_m)
        warn_user(
            f"no place of the trajectory is known to have seen {found.unseen} of {sample} points; they "
            "are not judged by rays",
            of=name,
        )
    others = [size for size in found.others_m3 if size >= _LEAST_OTHER_M3]
    if others:
        warn_user(
            f"the largest space that the points enclose is built; {len(others)} others of "
            f"{sum(others):.0f} m3 are not; --trajectory FILE says where the scanner was; the space that "
            "it saw is then built",
            of=name,
            option="--trajectory",
        )
