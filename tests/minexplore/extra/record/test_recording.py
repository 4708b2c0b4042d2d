"""A recording, read back by another library, and the map that is made of it."""

import shutil
import subprocess
import sys
from argparse import Namespace

import numpy as np
import pytest

from minexplore.envs.env import MineEnv
from minexplore.extra.record import command
from minexplore.extra.record.episode import composed, frames_of, inverse, level_pose
from minexplore.extra.record.live import LiveView
from minexplore.extra.record.mcap_file import McapFile
from minexplore.extra.record.policies import find_drive
from minexplore.sensing.lidar import surface_meshes
from minexplore.sensing.scanners import LABELS, Pose3D
from minexplore.world import load_world
from pipeline.geometry.ray_scene import load_open3d
from tests.forked import run_forked
from tests.project import ROOT

SENSORS = ("vlp-16", "depth", "rgb", "labels", "imu")


def turned(x, y, z, w):
    """Return the rotation matrix of a quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.fixture(scope="module")
def recorded(small_world, tmp_path_factory):
    """Return an episode's frames, and what rosbags reads of its recording: topics, times, messages, and definitions."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    env = MineEnv(small_world, pose="odometry", conditions="typical")
    path = tmp_path_factory.mktemp("record") / "episode.mcap"
    file, frames = McapFile(path, env.suite), []
    for frame in frames_of(env, lambda observation, info: np.array([1.0, 0.4]), SENSORS, 12, seed=0, every=4):
        file.add(frame)
        frames.append(frame)
    file.close()
    env.close()
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        messages = [
            (connection.topic, time, reader.deserialize(raw, connection.msgtype))
            for connection, time, raw in reader.messages()
        ]
        definitions = {connection.msgtype: connection.msgdef.data for connection in reader.connections}
    return frames, messages, definitions


def of_topic(recorded, topic):
    return [message for name, _, message in recorded[1] if name == topic]


def test_every_topic_is_read_back_at_its_rate(recorded):
    topics = {topic: len(of_topic(recorded, topic)) for topic, *_ in recorded[1]}
    images = {f"/camera/{name}/{part}": 4 for name in ("depth", "rgb", "labels") for part in ("image", "camera_info")}
    assert topics == {"/clock": 13, "/tf": 13, "/odom": 13, "/imu": 4, "/vlp_16/points": 4, **images}
    assert [m.clock.nanosec for m in of_topic(recorded, "/clock")][:3] == [0, 100_000_000, 200_000_000]


def test_definitions_are_those_of_ros_2(recorded):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    assert len(recorded[2]) == 7
    for name, text in recorded[2].items():
        for kind, definition in get_types_from_msg(text, name).items():
            assert definition == store.fielddefs[kind], kind


def test_images_and_clouds_are_those_of_the_sensors(recorded):
    frame = recorded[0][0]
    depth, info = of_topic(recorded, "/camera/depth/image")[0], of_topic(recorded, "/camera/depth/camera_info")[0]
    assert (depth.encoding, depth.header.frame_id) == ("32FC1", "camera_optical")
    np.testing.assert_array_equal(depth.data.view("<f4").reshape(240, 320), frame.readings["depth"])
    assert of_topic(recorded, "/camera/rgb/image")[0].encoding == "rgb8"
    assert info.k[0] == pytest.approx(120 / np.tan(np.radians(62) / 2))
    cloud, own = of_topic(recorded, "/vlp_16/points")[0], frame.readings["vlp-16"]
    rows = cloud.data.reshape(-1, cloud.point_step)
    offsets = {field.name: field.offset for field in cloud.fields}
    np.testing.assert_array_equal(
        rows[:, offsets["range"] : offsets["range"] + 4].copy().view("<f4")[:, 0], own.range_m
    )
    np.testing.assert_array_equal(rows[:, offsets["ring"] : offsets["ring"] + 2].copy().view("<u2")[:, 0], own.ring)
    np.testing.assert_array_equal(rows[:, offsets["label"]], own.label)


def pose_in_map(transforms, frame):
    """Return the pose of a frame in `map` by the transforms of one message."""
    of = {
        t.child_frame_id: (
            t.header.frame_id,
            Pose3D(
                np.array([t.transform.translation.x, t.transform.translation.y, t.transform.translation.z]),
                turned(*(getattr(t.transform.rotation, axis) for axis in "xyzw")),
            ),
        )
        for t in transforms
    }
    pose = Pose3D(np.zeros(3), np.eye(3))
    while frame != "map":
        frame, outer = of[frame]
        pose = composed(outer, pose)
    return pose


def test_the_robot_is_at_its_true_place_in_the_map_and_at_the_counted_one_in_odom(recorded):
    for frame, message, odometry in zip(
        recorded[0], of_topic(recorded, "/tf"), of_topic(recorded, "/odom"), strict=True
    ):
        found = pose_in_map(message.transforms, "base_link")
        np.testing.assert_allclose(found.place_m, frame.robot.place_m, atol=1e-9)
        np.testing.assert_allclose(found.axes, frame.robot.axes, atol=1e-9)
        assert odometry.pose.pose.position.x == pytest.approx(frame.counted.place_m[0])
        assert odometry.twist.twist.linear.x == pytest.approx(frame.speed_mps[0])
    assert np.linalg.norm(frame.counted.place_m[:2] - frame.robot.place_m[:2]) > 0.005


@pytest.mark.parametrize(("command", "ahead_mps"), [(0.4, 0.6), (-0.4, -0.6)])
def test_the_twist_has_the_sign_of_the_way(small_world, command, ahead_mps):
    env = MineEnv(small_world, pose="odometry")
    frames = list(frames_of(env, lambda observation, info: np.array([command, 0.3]), (), 10, seed=0))
    env.close()
    assert frames[0].speed_mps.tolist() == [0, 0, 0]
    assert frames[-1].speed_mps[0] == pytest.approx(ahead_mps, abs=0.1)
    assert frames[-1].speed_mps[1:] == pytest.approx([0, 0], abs=0.02)
    assert frames[-1].turn_radps == pytest.approx(0.45, abs=0.1)


def test_a_map_that_open3d_makes_of_the_recording_fits_the_world_within_a_decimetre(recorded, small_world):
    open3d = load_open3d()
    times = [time for topic, time, _ in recorded[1] if topic == "/vlp_16/points"]
    transforms = {time: message.transforms for topic, time, message in recorded[1] if topic == "/tf"}
    points = []
    for time, cloud in zip(times, of_topic(recorded, "/vlp_16/points"), strict=True):
        rows = cloud.data.reshape(-1, cloud.point_step)
        kept = rows[:, 26] != LABELS.index("dust")
        places = rows[kept, :12].copy().view("<f4").astype(float)
        points.append(pose_in_map(transforms[time], "vlp_16").points(places))
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.concatenate(points)))
    thinned = np.asarray(cloud.voxel_down_sample(0.05).points)
    scene = open3d.t.geometry.RaycastingScene()
    for vertices, faces in surface_meshes(load_world(small_world)).values():
        scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    rock_m = scene.compute_distance(thinned.astype(np.float32)).numpy()
    off_m = np.minimum(rock_m, np.abs(thinned[:, 2]))
    assert len(thinned) > 10_000
    assert np.percentile(off_m, 99) < 0.10
    assert np.median(off_m) < 0.03


def test_poses_are_composed_and_inverted():
    pose = level_pose(np.array([1.0, 2.0, 0.5]))
    back = composed(pose, inverse(pose))
    np.testing.assert_allclose(back.place_m, 0, atol=1e-12)
    np.testing.assert_allclose(back.axes, np.eye(3), atol=1e-12)


def test_an_explorer_drives_by_its_name_and_the_choices_are_listed(small_world):
    env = MineEnv(small_world, pose="odometry")
    drive = find_drive("nearest-frontier", env, 0, lambda observation: observation[:2])
    frames = list(frames_of(env, drive, (), 5, seed=0))
    assert len(frames) == 6
    assert frames[-1].coverage >= frames[0].coverage > 0
    with pytest.raises(ValueError, match=r"policy = 'clever': valid choices are random"):
        find_drive("clever", env, 0, lambda observation: observation[:2])
    env.close()


@pytest.mark.parametrize("driver", ["planner", "map-free", "nearest-frontier"])
def test_a_drive_to_a_goal_is_recorded_to_its_end(small_world, driver):
    env = MineEnv(small_world, pose="odometry", goal={"distance_m": (10.0, 15.0)})
    drive = find_drive(driver, env, 0, lambda observation, beams: observation[:2])
    frames = list(frames_of(env, drive, (), 400, seed=0))
    if driver == "planner":
        assert env.robots.rules.info(np.arange(1))["success"].all()
        assert len(frames) < 400
    env.close()


def test_a_driver_to_a_goal_is_refused_where_there_is_none(small_world):
    env = MineEnv(small_world)
    with pytest.raises(ValueError, match=r"policy = 'planner': want an id GoTo-\.\.\., and a robot with wheels"):
        find_drive("planner", env, 0, lambda observation, beams: observation[:2])
    env.close()


@pytest.mark.slow
def test_the_command_records_and_says_how_much(small_world, tmp_path):
    out = tmp_path / "episode.mcap"
    words = ["record", "MineXplore/World-v0", "--world", str(small_world), "--sensors", "mid-360,imu"]
    done = run_forked("minexplore", [*words, "--steps", "4", "--out", str(out)], ROOT)
    assert done.returncode == 0, done.stderr
    assert "4 steps, 5 looks, coverage" in done.stdout
    assert out.read_bytes().startswith(b"\x89MCAP")


def test_a_quadrotor_is_recorded_at_its_own_height_and_counts_no_pose(small_world, tmp_path):
    env = MineEnv(small_world, robot="quadrotor")
    path, frames = tmp_path / "flight.mcap", []
    file = McapFile(path, env.suite)
    for frame in frames_of(env, lambda observation, info: np.array([0.5, 0.0, 1.0, 0.1]), ("vlp-16", "imu"), 6, seed=0):
        file.add(frame)
        frames.append(frame)
    file.close()
    np.testing.assert_array_equal(frames[-1].counted.place_m, frames[-1].robot.place_m)
    assert frames[-1].robot.place_m[2] > frames[0].robot.place_m[2] + 0.1 > 1.1
    assert frames[-1].speed_mps[2] > 0.2  # it climbs
    cloud = frames[-1].readings["vlp-16"]
    places = env.suite.mount("vlp-16").on(frames[-1].robot).points(cloud.points_m)
    assert np.abs(places[np.array(LABELS)[cloud.label] == "floor", 2]).max() < 0.05
    assert path.stat().st_size > 100_000
    env.close()


def test_the_command_takes_another_robot_and_refuses_wheels_that_it_has_not(small_world, tmp_path, capsys):
    given = {"id": "MineXplore/World-v0", "world": str(small_world), "robot": "quadrotor", "policy": "random"}
    given |= {
        "sensors": "imu",
        "conditions": "typical",
        "pose": "true",
        "steps": 3,
        "every": 1,
        "seed": 0,
        "live": None,
    }
    given |= {"out": tmp_path / "flight.mcap", "live": None}
    command.record(Namespace(**given), lambda observation, beams: observation[:2])
    assert "3 steps, 4 looks" in (said := capsys.readouterr().out)
    assert "odometry" not in said
    with pytest.raises(ValueError, match=r"out = '.*': cannot be written \(Is a directory\)"):
        command.record(Namespace(**given | {"out": tmp_path}), lambda observation, beams: observation[:2])
    with pytest.raises(ValueError, match="pose = 'odometry': a quadrotor has no wheels; want true"):
        command.record(
            Namespace(**given | {"pose": "odometry", "out": tmp_path / "b.mcap"}),
            lambda observation, beams: observation[:2],
        )
    flown = (tmp_path / "flight.mcap").read_bytes()
    with pytest.raises(ValueError, match=r"out = '.*flight\.mcap': there is a file; move it away"):
        command.record(Namespace(**given), lambda observation, beams: observation[:2])
    assert (tmp_path / "flight.mcap").read_bytes() == flown
    assert [path.name for path in tmp_path.iterdir()] == ["flight.mcap"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sensors": "sonar"}, "sensors: 'sonar': want each once of rgb"),
        ({"steps": 0}, "steps = 0: want 1 or more"),
        ({"out": None}, "nothing to do: give --out FILE, --live, or both"),
        ({"live": 99999}, "live = 99999: want a port from 0 to 65535"),
        ({"live": -1}, "live = -1: want a port from 0 to 65535"),
    ],
)
def test_bad_options_are_refused_in_one_line(tmp_path, options, words):
    given = {"sensors": "imu", "steps": 5, "every": 1, "seed": 0, "out": tmp_path / "a.mcap", "live": None}
    with pytest.raises(ValueError, match=words):
        command.record(Namespace(**{**given, **options}), lambda observation: observation[:2])


def test_what_is_not_installed_is_named_with_its_extra(tmp_path, monkeypatch):
    monkeypatch.setattr("minexplore.extra.record.mcap_file.find_spec", lambda name: None)
    monkeypatch.setattr("minexplore.extra.record.live.find_spec", lambda name: None)
    given = {"sensors": "imu", "steps": 5, "every": 1, "seed": 0, "out": tmp_path / "a.mcap", "live": None}
    with pytest.raises(ImportError, match=r"pip install mcap mcap-ros2-support$"):
        command.record(Namespace(**given), lambda observation: observation[:2])
    with pytest.raises(ImportError, match=r"pip install viser$"):
        command.record(Namespace(**{**given, "out": None, "live": 0}), lambda observation: observation[:2])


def test_the_command_line_loads_neither_mcap_nor_viser_nor_open3d():
    program = "import sys, minexplore.__main__; print(sorted({name.partition('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "'minexplore'" in done.stdout
    assert not [name for name in ("mcap", "mcap_ros2", "viser", "open3d") if f"'{name}'" in done.stdout]


@pytest.mark.slow
def test_the_live_page_shows_the_cloud_in_chromium(small_world):
    pytest.importorskip("viser", reason="viser is not installed (extra `live`)")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (make setup)")
    names = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
    browser = next((path for name in names if (path := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no Chromium on this machine (Debian: chromium-headless-shell)")
    env = MineEnv(small_world, pose="odometry")
    view = LiveView(env.suite, 0)
    with playwright.sync_playwright() as run:
        arguments = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
        page = run.chromium.launch(executable_path=browser, args=arguments).new_page()
        errors = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.set_default_timeout(60_000)
        page.goto(view.address)
        page.locator("canvas").first.wait_for()
        for frame in frames_of(env, lambda observation, info: np.array([1.0, 0.0]), ("vlp-16", "depth"), 2, seed=0):
            view.add(frame)
        page.get_by_text("coverage").wait_for()
        assert errors == []
    view.close()
    env.close()
