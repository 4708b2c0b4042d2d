"""Pictures of a scan as a world: its points, what is left out of them, and how far they are from the world."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import laspy
import numpy as np

from benchmarks.comparisons.volume.cases import CASES
from benchmarks.scans.judge import scan_mine
from benchmarks.scans.sample import Scan
from benchmarks.scans.truth import mesh_of, network_of_floors
from pipeline.params.survey import CloudSurveyParams
from pipeline.report.figures.deviation import draw_deviation
from pipeline.store.files import write_atomically
from pipeline.survey.load import read_survey
from pipeline.types import Frame, Image
from pipeline.volume.floors import solve_floors
from pipeline.volume.world.proof.scan import measure_rays, measure_scan
from pipeline.volume.world.solid import volume_of_solid

_PER_M2, _SEED, _QUALITY = 200.0, 7, 85
_INK = (90, 90, 90)
_STEPS = ("", "-plan", "-deviation")  # of the pictures' names
_TITLES = ("points, the higher the lighter", "plan: red left out, blue closed", "")  # the third has its own


def draw_scan(path: Path) -> None:
    """Scan the T on a slope of the volume's gate, with a person and a vehicle in it, and draw each step.

    The scan has a trajectory, and its points have times.
    """
    rng = np.random.default_rng(_SEED)
    with tempfile.TemporaryDirectory() as folder:
        network = CASES["tee"].network(Path(folder))
        truth = solve_floors(network).solid
        scanned = scan_mine(truth, network_of_floors(mesh_of(truth)), rng, _PER_M2)
        file, way = Path(folder) / "scan.laz", Path(folder) / "way.txt"
        _write(file, scanned)
        np.savetxt(way, np.column_stack([np.arange(len(scanned.trajectory_m)), scanned.trajectory_m]), fmt="%.4f")
        params = CloudSurveyParams(kind="cloud", name="scan", file="data/x", heights=None)
        read = read_survey(params.model_copy(update={"file": file.as_posix(), "trajectory": way.as_posix()}))
    frame, solid = read["survey"].frame, read["solid"]
    volume = volume_of_solid(solid, 0.36)
    scan, rays = measure_scan(volume, solid.scan_m, rng), measure_rays(volume, {}, solid.rays_m)
    print(scan.figures, rays.figures, sep="\n")
    pictures = (
        _points(solid.scan_m, frame),
        read["plan"],
        draw_deviation(
            scan.points_m, scan.off_m, scan.unseen_m, frame, scan.figures, (rays.ends_m, rays.off_m, rays.figures)
        ),
    )
    for picture, title, step in zip(pictures, _TITLES, _STEPS, strict=True):
        cv2.putText(picture, title, (12, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 0), 1, cv2.LINE_AA)
        done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        assert done
        write_atomically(path.with_stem(path.stem + step), data.tobytes())


def _write(file: Path, scan: Scan) -> None:
    cloud = laspy.LasData(laspy.LasHeader(point_format=1, version="1.2"))
    cloud.header.scales = [0.001] * 3
    cloud.x, cloud.y, cloud.z = scan.points_m.T
    cloud.gps_time = scan.time_s
    cloud.write(str(file))


def _points(points_m: np.ndarray, frame: Frame) -> Image:
    """Return the points from above, shaded by height."""
    picture = np.full((frame.height_px, frame.width_px, 3), 255, np.uint8)
    order = np.argsort(points_m[:, 2])
    places = np.floor(frame.to_image(points_m[order, :2])).astype(int)
    share = np.linspace(0, 0.8, len(order))[:, None]
    picture[places[:, 1], places[:, 0]] = (np.array(_INK) * (1 - share) + 255 * share).astype(np.uint8)
    return picture
