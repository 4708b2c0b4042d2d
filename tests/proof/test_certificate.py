"""Certificate, parity and replay of a good world and of faulty ones."""

import dataclasses
import json
import math
import resource
import shutil
import subprocess
import sys

import mujoco
import numpy as np
import pytest
import shapely

from benchmarks.faults.injection import edit_model, edit_record, seal
from minexplore.bundle import GeomGroup
from pipeline.errors import ArtifactError, InputError
from pipeline.mjcf.bundle import open_bundle, part_vertices
from pipeline.mjcf.clearance import rock_clearance
from pipeline.proof.certificate import certify, measure_containment
from pipeline.proof.lidar.parity import compare_backends
from pipeline.proof.lidar.replay import find_sweeps, replay_sweeps
from pipeline.proof.lidar.replay_report import grade_along
from pipeline.proof.lidar.swept import swept_level
from pipeline.proof.stress_test import stress_walls
from pipeline.scans.sweeps import read_poses
from tests.mines import TEE, BuiltMine
from tests.project import ROOT

TRACING = (0.25, 2.0)


@pytest.fixture(scope="module")
def opened(tee: BuiltMine):
    return open_bundle(tee.bundle)


def without_stress(config):
    return config.validation.certificate.model_copy(update={"contacts": 0})


def test_a_good_world_has_a_certificate(tee, opened, config):
    params = config.validation.certificate.model_copy(update={"contacts": 200})
    found = measure_containment(tee.bundle, opened, tee.free_space, params, TRACING)
    certificate = certify(opened.record.world_sha256, found, params.limits)
    assert certificate.holds, [name for name, clause in certificate.clauses.items() if not clause.holds]
    assert certificate.contacts >= 200
    assert set(certificate.clauses) == set(params.limits)
    reachable = TEE.buffer(-0.35)
    assert found["reached_m2"] == pytest.approx(reachable.area, abs=reachable.length * params.cell_m / 2)


@pytest.mark.parametrize(("shift_m", "alike"), [(2e-7, True), (2e-4, False)])
def test_rounding_does_not_decide_about_a_row_of_cells_at_the_robots_radius(
    tee, opened, config, monkeypatch, shift_m, alike
):
    monkeypatch.setattr(
        "pipeline.proof.certificate.rock_clearance", lambda *args: np.maximum(rock_clearance(*args) - shift_m, 0.0)
    )
    params = without_stress(config).model_copy(update={"robot_radius_m": 0.375})  # walls lie 0.375 m beside a row
    found = measure_containment(tee.bundle, opened, tee.free_space, params, TRACING)
    assert (found["only_plan_m2"] == 0.0) == alike
    assert alike or found["only_plan_m2"] > params.limits["only_plan_m2"].max


def test_a_wall_across_a_drift_fails_the_expected_clauses(tee, config, tmp_path):
    bundle = tmp_path / "world"
    shutil.copytree(tee.bundle, bundle)

    def block(spec: mujoco.MjSpec) -> None:
        box = mujoco.mjtGeom.mjGEOM_BOX
        spec.body("mine").add_geom(
            spec.find_default("rock"), name="rock_more", type=box, size=[0.25, 4, 1.75], pos=[60, 2.5, 1.75]
        )

    edit_model(block)(bundle)
    seal(bundle)
    params = without_stress(config)
    world = open_bundle(bundle, checked=False)
    found = measure_containment(bundle, world, tee.free_space, params, TRACING)
    certificate = certify(world.record.world_sha256, found, params.limits)
    assert not certificate.holds
    failed = {name for name, clause in certificate.clauses.items() if not clause.holds}
    assert {"intrusion_mm", "clearance_error_m", "only_plan_m2", "same_graph"} <= failed
    assert "gap_mm" not in failed
    assert found["intrusion_m2"] == pytest.approx(0.5 * 5, rel=0.02)


def test_the_certificate_slices_by_the_frame_that_the_record_states(tee, opened, config):
    T = np.array(opened.record.T_world_mine)
    T[:3, 3] += 0.1 * T[:3, 1]  # the record puts the mine 0.1 m farther north than the model does
    moved = dataclasses.replace(opened, record=dataclasses.replace(opened.record, T_world_mine=T.tolist()))
    found = measure_containment(tee.bundle, moved, tee.free_space, without_stress(config), TRACING)
    assert found["intrusion_m2"] == pytest.approx(0.1 * 80, rel=0.01)  # along the 80 m of walls that face south


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            edit_record(lambda record: record["geom_groups"].pop("collision")),
            r"world\.json: geom_groups = \{.*\}: want",
        ),
        (edit_model(lambda spec: setattr(spec.body("mine"), "name", "pit")), "no body of the name mine"),
    ],
)
def test_a_bundle_without_the_expected_groups_or_body_is_refused(tee, tmp_path, change, message):
    bundle = tmp_path / "world"
    shutil.copytree(tee.bundle, bundle)
    change(bundle)
    seal(bundle)
    with pytest.raises(ArtifactError, match=message):
        open_bundle(bundle)


def test_distances_by_mujoco_equal_the_distances_to_the_plans_walls(tee, opened):
    rng = np.random.default_rng(0)
    places = rng.uniform([-1, -1], [81, 41], (2000, 2))
    free = tee.free_space.polygon
    T = np.array(opened.record.T_world_mine)
    probes = np.column_stack([places, np.full(len(places), 0.5)])
    found = rock_clearance(tee.bundle, T, GeomGroup.COLLISION, probes, 2.0)
    inside = shapely.contains_xy(free, places[:, 0], places[:, 1])
    exact = np.where(inside, np.minimum(shapely.distance(free.boundary, shapely.points(places)), 2.0), 0.0)
    assert np.abs(found - exact)[inside].max() < 1e-3
    assert (found[shapely.contains_xy(free.buffer(4).difference(free), places[:, 0], places[:, 1])] == 0).all()


def test_robots_thrown_at_every_kind_of_target_stay_inside(tee, opened):
    parts = part_vertices(opened.model, GeomGroup.COLLISION)
    borders = [zone.east_m for zone in opened.record.zones[:-1]]
    found = stress_walls(tee.bundle, tee.free_space.polygon, parts, borders, 1000, 1)
    assert found.contacts >= 1000
    assert found.escapes == 0
    assert set(found.targets) == {"corners", "seams", "zone borders", "tile borders", "walls"}


def test_the_ranges_of_all_backends_agree(tee, opened):
    report = compare_backends(tee.bundle, opened, tee.free_space.polygon, 2000, seed=0)
    assert {"Open3D RaycastingScene", "local models of the environment", "Nav2 map"} <= set(report.backends)
    for name, found in report.backends.items():
        assert found.agree == found.rays > 50, (name, found.disagreements)


def test_a_map_that_is_shifted_by_two_cells_disagrees(tee, opened, tmp_path):
    bundle = tmp_path / "world"
    shutil.copytree(tee.bundle, bundle)
    text = (bundle / "map.yaml").read_text()
    west = float(text.split("origin: [")[1].split(",")[0])
    (bundle / "map.yaml").write_text(text.replace(f"origin: [{west:.6f}", f"origin: [{west + 0.5:.6f}"))
    seal(bundle)
    found = compare_backends(bundle, open_bundle(bundle, checked=False), tee.free_space.polygon, 1000, seed=0).backends[
        "Nav2 map"
    ]
    assert found.agree < found.rays


# --- replay --------------------------------------------------------------------------------------------------------

POSES = {"00A": (8.0, 2.4, 0.1), "01A": (36.0, 2.6, -0.2), "02A": (40.3, 20.0, 1.4)}


def write_sweeps(folder, tee, opened, noise=0.01, shift=(0.0, 0.0)):
    """Write the sweeps of a scanner at POSES in the collision world, in the derived format of the dataset."""
    from pipeline.geometry.raycast import RayCaster
    from pipeline.mjcf.bundle import geom_triangles

    caster = RayCaster(geom_triangles(opened.model, GeomGroup.COLLISION))
    rng = np.random.default_rng(3)
    folder.mkdir()
    bearing = np.radians(np.arange(-161.0, 161.0, 0.5))
    for name, (x, y, heading) in POSES.items():
        ranges = caster.fan(np.array([[x, y]]), (heading + bearing)[None], 1.0)[0]
        hit = np.isfinite(ranges)
        rows = [
            f"{k * 0.1},{b},1e-6,{r},1e-4"
            for k, (b, r) in enumerate(zip(bearing[hit], ranges[hit] + rng.normal(0, noise, hit.sum()), strict=True))
        ]
        (folder / f"sweep_{name}.csv").write_text("times,theta_mu,theta_var,range_mu,range_var\n" + "\n".join(rows))
    lines = [f"{n},{x + shift[0]},{y + shift[1]},{h},{3 + 0.05 * x}" for n, (x, y, h) in POSES.items()]
    (folder / "poses.csv").write_text("pose_num,x_truth,y_truth,theta_truth,z_truth\n" + "\n".join(lines) + "\n")


def test_sweeps_cast_in_the_world_are_replayed_with_errors_equal_to_their_noise(tee, opened, config, tmp_path):
    write_sweeps(tmp_path / "s", tee, opened, shift=(3.0, -2.0))
    level = swept_level(opened, tee.free_space.polygon)
    found = replay_sweeps(level, tmp_path / "s/poses.csv", find_sweeps(tmp_path / "s"), config.validation.replay).report
    assert found.shift_m == pytest.approx((-3.0, 2.0), abs=0.3)
    assert found.scale == pytest.approx(1.0, abs=0.01)
    assert found.grade_deg == pytest.approx(math.degrees(math.atan(0.05)), abs=1.5)
    assert found.world_grade_deg == pytest.approx(-opened.record.tilt_deg)
    for name, sweep in found.sweeps.items():
        assert sweep.collision.median_m < 0.03, name
        assert sweep.collision.within_0_25_m > 0.95
        assert sweep.visible.median_m > sweep.collision.median_m  # they were cast at the collision walls
        assert sum(sweep.gated.values()) + sweep.used == sweep.returns
        assert sweep.pose_m[:2] == pytest.approx(POSES[name][:2], abs=0.1)


def test_replay_refuses_a_folder_without_sweeps_and_a_sweep_without_pose(tee, opened, config, tmp_path):
    level, params = swept_level(opened, tee.free_space.polygon), config.validation.replay
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match=r"no file is named sweep_NAME\.csv"):
        find_sweeps(tmp_path / "none")
    write_sweeps(tmp_path / "s", tee, opened)
    poses = tmp_path / "s/poses.csv"
    poses.write_text("\n".join(poses.read_text().splitlines()[:2]) + "\n")
    with pytest.raises(InputError, match="sweep 01A has no pose"):
        replay_sweeps(level, poses, find_sweeps(tmp_path / "s"), params)


def test_a_sweep_without_returns_in_range_is_refused(tee, opened, config, tmp_path):
    write_sweeps(tmp_path / "s", tee, opened)
    far = config.validation.replay.model_copy(update={"max_range_m": 0.5})
    with pytest.raises(InputError, match=r"sweep_00A\.csv: no return passes the gates"):
        replay_sweeps(
            swept_level(opened, tee.free_space.polygon), tmp_path / "s/poses.csv", find_sweeps(tmp_path / "s"), far
        )


def test_pose_estimates_with_quaternions_are_read(tmp_path):
    path = tmp_path / "scanPoseEstimates.dat"
    path.write_text("0 0 0 0 1 0 0 0\n1 0 0 0.7071068 0.7071068 10 2 -0.5\n")
    poses = read_poses(path)
    assert poses["1"] == pytest.approx((10, 2, math.pi / 2, -0.5), abs=1e-6)
    path.write_text("0 0 0 0 1 0 0\n")
    with pytest.raises(InputError, match="line 1 has 7 values"):
        read_poses(path)


def test_a_grade_is_the_median_slope():
    x = np.linspace(0, 100, 50)
    points = np.column_stack([x, 0.2 * x, np.tan(math.radians(5)) * x * math.hypot(1, 0.2)])
    points[7, 2] += 40
    assert grade_along(points) == pytest.approx(5.0, abs=0.05)


@pytest.mark.slow
def test_the_published_sweeps_fit_the_walls_of_the_published_plan(shared_mine, built):
    """The world is that of the station survey; `make test-slow` measures the world of the plan."""
    done = built.run(
        sys.executable,
        "-m",
        "pipeline",
        "replay",
        "--bundle",
        "artifacts/realism/world",
        "--sweeps",
        str(shared_mine),
        "--poses",
        str(shared_mine / "scan_poses.csv"),
    )
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert set(report["sweeps"]) == {"00S", "11S", "25S", "40S"}
    assert sorted(s["collision"]["median_m"] for s in report["sweeps"].values())[2] < 0.6
    assert report["largest_correction_m"] <= report["correction_bound_m"]


@pytest.mark.slow
def test_the_default_world_is_certified_with_20000_contacts_within_four_gigabytes_of_addresses(built):
    bundle = built.folder / "artifacts/realism/world"
    command = [sys.executable, "-m", "pipeline", "certify", "--bundle", str(bundle), "--contacts", "20000"]
    most = 4_000_000 * 1024  # `ulimit -v 4000000`

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (most, most))

    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, preexec_fn=limit)
    assert done.returncode == 0, done.stderr[-2000:]
    assert json.loads(done.stdout)["holds"]
