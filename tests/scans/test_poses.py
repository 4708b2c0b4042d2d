import math

import numpy as np
import pytest
import shapely

from minesurveys.pictures.image import read_image
from pipeline.errors import InputError
from pipeline.scans.poses import scale_from_poses
from pipeline.scans.sweeps import Returns, SurveyedPose, gate_returns, read_poses, read_returns, read_sweep
from pipeline.types import Frame
from tests.mines import plan_of

# A drift with side cuts, so that a sweep also fixes the position along the drift.
MINE = shapely.union_all(
    [shapely.box(0, 0, 160, 6), shapely.box(30, 6, 36, 18), shapely.box(90, -12, 95, 0), shapely.box(120, 6, 127, 15)]
)


def cast(place, heading, count=360, reach=40.0):
    """Return the returns of a planar scanner."""
    returns = []
    for bearing in np.linspace(-math.pi, math.pi, count, endpoint=False):
        ray = shapely.LineString(
            [place, (place[0] + reach * math.cos(heading + bearing), place[1] + reach * math.sin(heading + bearing))]
        )
        hit = ray.intersection(MINE.boundary)
        if not hit.is_empty:
            distance = shapely.distance(shapely.Point(place), hit)
            returns.append((bearing, distance, 0.0))
    return Returns(*np.array(returns).T)


def test_the_true_scale_is_recovered_from_sweeps():
    true = 6.5
    frame = Frame(true, 50.5, 150.5, 1150, 260)
    poses = {"0": SurveyedPose(20, 3, 0.1), "1": SurveyedPose(85, 2.5, -0.2), "2": SurveyedPose(124, 3.5, 3.0)}
    sweeps = {name: cast((x, y), heading, 180) for name, (x, y, heading, _) in poses.items()}
    fit = scale_from_poses(plan_of(MINE, frame), poses, sweeps, (55, 148), (6.2, 6.8))
    assert fit.px_per_m == pytest.approx(true, rel=0.01)
    assert fit.low_px_per_m <= fit.px_per_m <= fit.high_px_per_m
    assert fit.error_m < 0.15


def test_a_range_without_the_true_scale_is_refused():
    frame = Frame(6.5, 50.5, 150.5, 1150, 260)
    poses = {"0": SurveyedPose(20, 3, 0.1), "1": SurveyedPose(124, 2.5, -0.2)}
    sweeps = {name: cast((x, y), heading) for name, (x, y, heading, _) in poses.items()}
    with pytest.raises(InputError, match="no scale inside 9-14 px/m"):
        scale_from_poses(plan_of(MINE, frame), poses, sweeps, (50, 150), (9.0, 14.0))


def test_a_sweep_without_a_pose_is_named():
    with pytest.raises(InputError, match="sweep 7 has no pose"):
        scale_from_poses(
            plan_of(MINE, Frame(2, 10, 50, 400, 90)), {}, {"7": Returns(*np.zeros((3, 40)))}, (0, 0), (1, 3)
        )


@pytest.mark.slow
def test_the_published_sweeps_imply_a_smaller_scale_than_the_bar(shared_mine):
    """At 7.82 px/m the sweeps' junctions are 2 m away from the plan's. The paper's length of 697 m implies 7.65."""
    plan = read_image(shared_mine / "plan.jpg", 100)
    poses = read_poses(shared_mine / "scan_poses.csv")
    assert len(poses) == 44
    files = {k: shared_mine / f"sweep_{k}.csv" for k in ("00S", "11S", "25S", "40S")}
    sweeps = {k: gate_returns(file, read_returns(file), 25.0, 0.05) for k, file in files.items()}
    fit = scale_from_poses(plan, poses, sweeps, (745, 785), (7.4, 8.2))
    assert fit.px_per_m == pytest.approx(7.65, rel=0.01)
    assert fit.high_px_per_m < 7.82
    assert fit.error_m < 0.7


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column"),
        ("theta_mu,range_mu,range_var\n", "0 usable returns of 0"),
        ("theta_mu,range_mu,range_var\nx,1,0\n", "'x' is not a number"),
        ("theta_mu,range_mu,range_var\nnan,1,0\n", "nan is not finite"),
        ("theta_mu,range_mu,range_var\n" + "0,99,0\n" * 50, "0 usable returns of 50"),
    ],
)
def test_a_sweep_that_cannot_be_used_is_refused(tmp_path, text, message):
    path = tmp_path / "sweep.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_sweep(path, 40.0, 0.05)
