import gymnasium
import numpy as np
import pytest
from safetensors.numpy import save_file

from baselines.confined import Confined, ConfinedPolicy
from baselines.environments import make_env
from baselines.errors import BaselineError
from baselines.explorers.map_graph import map_graph
from baselines.explorers.own_map import OwnMap
from baselines.explorers.pursuit import PathFollower
from baselines.graph.checkpoint import read_network, write_network
from baselines.graph.choosing import LearnedChoice, choose_nearest, keeps_goal
from baselines.graph.convoy import Convoy
from baselines.graph.expert import Expert, Trial
from baselines.graph.features import MOST, NAMES, describe
from baselines.graph.label_files import read_labels, write_labels
from baselines.graph.map_stack import MapStack
from baselines.graph.mines import make_simulator
from baselines.graph.network import Shape, array_shapes, scores
from baselines.graph.senses import Senses
from baselines.graph.settings import compose_settings
from baselines.graph.simulator import MapSimulator
from baselines.policy import make_policy, trained_in
from baselines.protocol import run_episodes
from minexplore.robot import RobotParams
from minexplore.robot_batch import RobotBatch
from minexplore.task import TaskParams
from minexplore.world import load_world

TASK, ROBOT = TaskParams(terrain=False, max_steps=600), RobotParams()
SHAPE = Shape(width=16, heads=2, blocks=2, attention=True, stubs=True)


@pytest.fixture(scope="module")
def world(tee):
    return load_world(tee.bundle)


def random_poses(world, count, seed=0):
    rng = np.random.default_rng(seed)
    places = world.places_m(ROBOT.radius_m + 0.05)
    chosen = places[rng.integers(len(places), size=count)]
    return np.column_stack([chosen, rng.uniform(-np.pi, np.pi, count)])


def random_arrays(shape, seed=0):
    rng = np.random.default_rng(seed)
    return {name: rng.normal(0, 0.3, size).astype(np.float32) for name, size in array_shapes(shape).items()}


def compare_sight(world, count):
    """Compare ranges and seen cells of the simulator with the environment's, pose by pose."""
    batch = RobotBatch(world, TASK, ROBOT, 1)
    senses, poses = Senses(world, TASK, ROBOT), random_poses(world, count)
    ranges = senses.cast(poses)
    pose, row, col = senses.cells(poses, ranges)
    only = np.array([0])
    for k, (x, y, yaw) in enumerate(poses.tolist()):
        batch.place(0, x, y, yaw)
        batch.seen[:] = False
        true = batch.true_ranges(only)[0]
        np.testing.assert_allclose(ranges[k][np.argsort(senses.bearings % (2 * np.pi))], true, atol=1e-6)
        batch._look(only)
        seen = np.zeros_like(batch.seen)
        senses.grid.mark(seen, np.zeros((pose == k).sum(), dtype=int), row[pose == k], col[pose == k])
        np.testing.assert_array_equal(seen, batch.seen)
    batch.close()


def test_the_same_beams_see_the_same_cells_as_in_the_environment(world):
    compare_sight(world, 300)


@pytest.mark.slow
def test_the_same_beams_see_the_same_cells_in_ten_thousand_poses(world):
    compare_sight(world, 10_000)


def test_a_stack_of_maps_is_what_each_robot_maps_alone(world):
    senses = Senses(world, TASK, ROBOT)
    stack, robots = MapStack(senses.grid, 3), np.arange(3)
    alone = [OwnMap(TASK.cell_m) for _ in robots]
    for k in range(6):
        poses = random_poses(world, 3, seed=k)
        ranges = senses.cast(poses)
        stack.add(robots, poses, senses.bearings, ranges, TASK.range_m[1])
        for own, pose, row in zip(alone, poses, ranges, strict=True):
            own.add(pose[:2], pose[2] + senses.bearings, row, TASK.range_m[1])
    for robot, own in enumerate(alone):
        view = stack.view(robot)
        assert own.seen.sum() == view.seen.sum() > 20
        seen = np.argwhere(own.seen)[:, ::-1] + own.low - view.low
        assert view.seen[seen[:, 1], seen[:, 0]].all()
        for kind in (1, 2):
            fine = np.argwhere(own.fine == kind)[:, ::-1] + (own.low - view.low) * 5
            assert len(fine) == (view.fine == kind).sum()
            assert (view.fine[fine[:, 1], fine[:, 0]] == kind).all()


def test_a_convoy_follows_as_each_robot_does_alone():
    rng, follower, convoy = np.random.default_rng(0), PathFollower(TASK, ROBOT), Convoy(TASK, ROBOT, 40)
    poses = np.column_stack([rng.uniform(0, 5, (40, 2)), rng.uniform(-np.pi, np.pi, 40)])
    ranges = rng.uniform(0.3, 6.0, (40, TASK.beams))
    paths = [np.cumsum(rng.uniform(-0.5, 0.5, (rng.integers(1, 60), 2)), axis=0) + pose[:2] for pose in poses]
    for robot, path in enumerate(paths):
        convoy.take(robot, path)
    alone = [follower.follow(*each) for each in zip(paths, poses, ranges, strict=True)]
    np.testing.assert_allclose(convoy.follow(np.arange(40), poses, ranges), alone, atol=1e-12)
    convoy.take(3, None)
    assert convoy.follow(np.array([3]), poses[:1], ranges[:1]).tolist() == [[0.0, 0.5]]


def explored(world, robots=3, seconds=25.0, rule=choose_nearest):
    """Return a simulator whose robots have explored; their graphs are compared with those of `map_graph`."""
    sim, rng, exact = MapSimulator(world, TASK, ROBOT, robots), np.random.default_rng(1), []

    def choose(asked, situations):
        for robot, situation in zip(asked.tolist(), situations, strict=True):
            own, keep = sim.planners[robot].map, sim.planners[robot]._worth
            whole, grown = map_graph(own, ROBOT.radius_m, keep), situation.graph
            assert whole.cells.tolist() == grown.cells.tolist()
            np.testing.assert_array_equal(whole.cluster, grown.cluster)
            np.testing.assert_allclose(whole.places, grown.places)
            # Samples half way between two fine cells are rounded by where the window of `map_graph` begins.
            begins = np.argwhere(own.seen | (own.frontier() & keep)).min(axis=0) - 1
            if (begins % 2 == 0).all():
                exact.append(abs(whole.links - grown.links).max())
        return [rule(each, sim.context(i)) for i, each in zip(asked.tolist(), situations, strict=True)]

    sim.reset(np.arange(robots), np.array([0.0, 2.0, 4.0])[:robots], rng)
    sim.run(choose, np.arange(robots), np.full(robots, seconds), rng)
    assert robots < 3 or (len(exact) > 0 and max(exact) < 1e-9)
    return sim


def test_robots_explore_on_the_graph_that_the_classical_explorers_make_of_the_same_map(world):
    sim = explored(world)
    assert (sim.cells_seen > 30).all()
    assert (sim._clearance(sim.poses[:, :2]) >= ROBOT.radius_m).all()
    moved = np.linalg.norm(sim.poses[:, :2] - world.record["spawn"]["anchor_m"], axis=1)
    assert (moved <= TASK.max_forward_mps * 25).all()


def test_a_forked_robot_goes_on_as_the_first_one_and_neither_disturbs_the_other(world):
    sim = explored(world, robots=1)
    twins = MapSimulator(world, TASK, ROBOT, 2)

    def choose(asked, situations):
        return [choose_nearest(each, twins.context(i)) for i, each in zip(asked.tolist(), situations, strict=True)]

    twins.reset(np.array([0]), np.array([0.5]), np.random.default_rng(2))
    twins.run(choose, np.array([0]), np.array([10.0, 10.0]), np.random.default_rng(2))
    twins.fork(0, np.array([1]))
    for robot in (0, 1):  # one after the other, with the same noise
        twins.run(choose, np.array([robot]), np.array([30.0, 30.0]), np.random.default_rng(3))
    np.testing.assert_array_equal(twins.poses[0], twins.poses[1])
    assert twins.cells_seen[0] == twins.cells_seen[1]
    assert sim.count == 1


def test_scenes_hold_what_the_situation_says(world):
    sim = explored(world, robots=2, seconds=8.0)
    situation = sim.planners[0].look_around(sim.poses[0, :2])
    scene = describe(situation, sim.context(0))
    assert scene.tokens.shape == (len(scene.clusters), len(NAMES))
    assert np.isfinite(scene.tokens).all()
    assert len(scene.clusters) <= MOST
    path = scene.tokens[:, NAMES.index("path")] * 20
    costs = situation.costs[scene.clusters] + 3.0 * (scene.clusters == situation.present)
    np.testing.assert_allclose(path, costs, rtol=1e-5)
    np.testing.assert_allclose(scene.apart_m, scene.apart_m.T, rtol=1e-5)
    assert scene.tokens[0, NAMES.index("time_left")] == pytest.approx((60.0 - 8.0) / 600, abs=1e-3)


def test_a_goal_is_kept_for_five_seconds_unless_the_robot_stands_still(world):
    sim = explored(world, robots=1, seconds=8.0)
    situation = sim.planners[0].look_around(sim.poses[0, :2])
    context = sim.context(0)
    moving = type(context)(context.own, context.pose, 50.0, 0.0, 2.0)
    assert keeps_goal(situation, moving) == (situation.present >= 0)
    assert not keeps_goal(situation, type(context)(context.own, context.pose, 50.0, 0.0, 6.0))
    assert not keeps_goal(situation, type(context)(context.own, context.pose, 50.0, 5.5, 5.5))


def test_the_expert_prefers_the_cluster_behind_which_there_is_more(world):
    sim = MapSimulator(world, TASK, ROBOT, 2 * (1 + 4))
    trial = Trial(robots=2, clusters=4, horizon_s=20.0, every_s=(5.0, 15.0), wander=0.2)
    labels = Expert(sim, trial, choose_nearest, choose_nearest, np.random.default_rng(0)).label_episode()
    tried = ~np.isnan(labels.cells)
    assert len(labels.cells) >= 2
    assert (tried.sum(axis=1) >= 2).all()
    assert (tried <= labels.real).all()
    assert (labels.cells[tried] >= 0).all()
    assert labels.cells[tried].max() > labels.cells[tried].min()


def test_labels_come_back_from_their_files_and_other_files_are_refused(tmp_path, world):
    sim = MapSimulator(world, TASK, ROBOT, 4)
    trial = Trial(robots=1, clusters=3, horizon_s=5.0, every_s=(10.0, 15.0), wander=0.0)
    labels = Expert(sim, trial, choose_nearest, choose_nearest, np.random.default_rng(0)).label_episode()
    write_labels(tmp_path / "a.npz", labels)
    twice = read_labels([tmp_path / "a.npz"] * 2)
    np.testing.assert_array_equal(twice.cells, np.concatenate([labels.cells] * 2))
    (tmp_path / "b.npz").write_bytes(b"nothing")
    with pytest.raises(BaselineError, match=r"b\.npz: not a file of labels"):
        read_labels([tmp_path / "b.npz"])


@pytest.mark.parametrize("changes", [{}, {"attention": False}, {"stubs": False}, {"blocks": 0}])
def test_the_network_is_the_same_in_torch_and_in_numpy(changes):
    torch = pytest.importorskip("torch")
    from baselines.graph.fit import arrays_of
    from baselines.graph.torch_network import GraphNetwork

    shape, rng = SHAPE.model_copy(update=changes), np.random.default_rng(0)
    network = GraphNetwork(shape)
    arrays = arrays_of(network)
    assert {name: array.shape for name, array in arrays.items()} == array_shapes(shape)
    tokens, apart = rng.normal(size=(7, len(NAMES))).astype(np.float32), rng.uniform(0, 60, (7, 7)).astype(np.float32)
    filled = [np.zeros((1, MOST, len(NAMES)), np.float32), np.ones((1, MOST, MOST), np.float32)]
    filled[0][0, :7], filled[1][0, :7, :7] = tokens, apart
    real = torch.arange(MOST)[None] < 7
    theirs = network(*(torch.from_numpy(array) for array in filled), real)[0][0].detach().numpy()
    np.testing.assert_allclose(scores(arrays, shape, tokens, apart), theirs[:7], atol=1e-5)
    assert (theirs[7:] < -1e8).all()


def test_the_fit_learns_which_clusters_bring_more():
    pytest.importorskip("torch")
    from baselines.graph.expert import Labels
    from baselines.graph.fit import arrays_of, fit

    rng = np.random.default_rng(0)
    tokens = rng.normal(size=(400, MOST, len(NAMES))).astype(np.float32)
    cells = (50 + 20 * tokens[..., NAMES.index("unknown")] + rng.normal(size=(400, MOST))).astype(np.float32)
    cells[rng.random(cells.shape) < 0.5] = np.nan
    labels = Labels(tokens, np.full((400, MOST, MOST), 10, np.float32), np.ones((400, MOST), dtype=bool), cells)
    settings = compose_settings(["fit.epochs=80"]).fit
    network, figures = fit(labels, SHAPE, settings, 0)
    assert figures["chosen_above_nearest"] > 0.8 * figures["best_above_nearest"] > 5
    found = scores(arrays_of(network), SHAPE, tokens[0], labels.apart_m[0])
    assert found.argmax() == tokens[0, :, NAMES.index("unknown")].argmax()


def test_a_network_on_disk_drives_robots_here_and_confined_and_needs_no_torch(tmp_path, short_id):
    file = tmp_path / "graph-1.safetensors"
    write_network(file, random_arrays(SHAPE), SHAPE, 1, {})
    assert trained_in(file) == "MineXplore/Family-v0"
    env = make_env(short_id, 2)
    policy = make_policy(str(file), 2, env.task, env.robot)
    episodes = list(run_episodes(env, policy, [0, 1]))
    assert all(episode.seen[-1] > episode.seen[0] for episode in episodes)
    with ConfinedPolicy(str(file), 2, env.task, env.robot, Confined()) as confined:
        again = list(run_episodes(env, confined, [0, 1]))
    assert again == episodes
    env.close()


def test_a_broken_network_is_refused_with_its_reason(tmp_path):
    file, arrays = tmp_path / "n.safetensors", random_arrays(SHAPE)
    for change, message in (
        ({"enter.weight": np.zeros((16, 3), np.float32)}, r"enter\.weight has shape \(16, 3\)"),
        ({"score.bias": np.full(2, np.nan, np.float32)}, r"score\.bias: want finite numbers"),
    ):
        write_network(file, arrays | change, SHAPE, 1, {})
        with pytest.raises(BaselineError, match=message):
            read_network(file)
    save_file(arrays, str(file), metadata={"format": "minexplore-graph/1", "features": "other"})
    with pytest.raises(BaselineError, match="its features are not those of this version"):
        read_network(file)
    file.write_bytes(b"nothing")
    with pytest.raises(BaselineError, match="not a network's file"):
        read_network(file)


def test_the_learned_choice_is_the_cluster_of_the_highest_score(world):
    sim = explored(world, robots=1, seconds=6.0)
    situation = sim.planners[0].look_around(sim.poses[0, :2])
    context = sim.context(0)
    free = type(context)(context.own, context.pose, context.time_left_s, 0.0, 10.0)
    arrays, scene = random_arrays(SHAPE), describe(situation, free)
    best = scene.clusters[scores(arrays, SHAPE, scene.tokens, scene.apart_m).argmax()]
    assert LearnedChoice(arrays, SHAPE)(situation, free) == best


def test_training_refuses_mines_that_policies_are_judged_by(world, monkeypatch, tee):
    gymnasium.register("MineXplore/Judged-v0", "minexplore.env:MineEnv", kwargs={"world": str(tee.bundle)},
                       vector_entry_point="minexplore.vector:MineVectorEnv")  # fmt: skip
    try:
        make_simulator("Judged", 1)
        monkeypatch.setitem(world.record, "name", "light-test-0007")
        with pytest.raises(BaselineError, match="is of the split test, which nothing is trained in"):
            make_simulator("Judged", 1)
    finally:
        del gymnasium.registry["MineXplore/Judged-v0"]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("mines=0", "mines = 0"),
        ("network.heads=5", "want a multiple of network.heads = 5"),
        ("labels.wander=2", "labels.wander = 2"),
        ("nothing=1", "nothing"),
    ],
)
def test_settings_that_cannot_be_are_refused(override, message):
    with pytest.raises(BaselineError, match=message):
        compose_settings([override])


def test_a_run_is_resumed_where_it_ended_and_its_policy_is_found_by_name(tmp_path, monkeypatch, short_id):
    pytest.importorskip("torch")
    from baselines import policy as policies
    from baselines.graph import train

    monkeypatch.setattr(train, "training_ids", lambda count: [short_id] * count)
    small = ["mines=2", "watched=1", "labels.rounds=2", "labels.mines=1", "labels.robots=1", "labels.clusters=2"]
    small += ["labels.horizon_s=4", "labels.every_s=[4,8]", "fit.epochs=2", "network.width=16", "network.heads=2"]
    settings = compose_settings([*small, "improve.robots=2"])
    run = train.Run(tmp_path / settings.label, settings)
    file = train.train(run)
    first = {path: path.stat().st_mtime_ns for path in (tmp_path / settings.label).rglob("*-*.*")}
    assert len(list((tmp_path / settings.label / "labels").iterdir())) == 2
    longer = settings.model_copy(update={"improve": settings.improve.model_copy(update={"updates": 1})})
    train.train(train.Run(tmp_path / settings.label, longer))
    assert all(path.stat().st_mtime_ns == then for path, then in first.items())  # nothing was done twice
    assert (tmp_path / settings.label / "improved-00001.safetensors").is_file()
    monkeypatch.setattr(policies, "TRAINED", tmp_path)
    assert make_policy(settings.label, 1, TASK, ROBOT).path == file
    other = settings.model_copy(update={"seed": 7})
    with pytest.raises(BaselineError, match="holds a run of other settings"):
        train.Run(tmp_path / settings.label, other)


def test_decisions_are_credited_with_what_their_robot_sees_more_than_the_others_of_the_mine():
    pytest.importorskip("torch")
    from baselines.graph.improve import Episode, advantages

    seen = [np.array([0, 0]), np.array([10, 0]), np.array([20, 0]), np.array([20, 40])]
    episode = Episode(robots=[0, 1, 1], time_s=[0.0, 0.0, 10.0], seen=seen)
    credit = advantages(episode, horizon_s=10.0)
    raw = np.array([10.0, -10.0, 20.0])  # 20 and 0 cells in ten seconds; then 0 and 40, until the episode ends
    np.testing.assert_allclose(credit, raw / raw.std())
