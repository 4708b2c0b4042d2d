import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from safetensors.numpy import save_file

from baselines.base.environments import make_env
from baselines.base.errors import BaselineError
from baselines.explorers.maps.map_graph import map_graph
from baselines.explorers.maps.own_map import FINE, ROCK, UNKNOWN, OwnMap
from baselines.explorers.pursuit import PathFollower
from baselines.graph.checkpoint import read_network, write_network
from baselines.graph.choosing import LearnedChoice, choose_nearest, keeps_goal
from baselines.graph.features import MOST, NAMES, GroundAbout, describe
from baselines.graph.floor_speeds import FloorSpeeds
from baselines.graph.map_stack import MapStack
from baselines.graph.network import Shape, array_shapes, scores
from baselines.graph.scenes import Scenes
from baselines.graph.training.convoy import Convoy
from baselines.graph.training.episodes import Decisions, Network, credits, join, sample
from baselines.graph.training.fresh_ground import fresh_ground
from baselines.graph.training.senses import Senses
from baselines.graph.training.settings import compose_settings
from baselines.graph.training.simulator import MapSimulator
from baselines.graph.training.train import make_simulator
from baselines.policies.policy_lookup import make_policy, trained_in
from baselines.running.protocol import run_episodes
from baselines.sandbox.confined import Confined, ConfinedPolicy
from minexplore.envs.robot_batch import RobotBatch
from minexplore.physics.robot import RobotParams
from minexplore.sensing.coverage import mark
from minexplore.task import TaskParams
from minexplore.world import load_world
from tests.volumes import BOX, build_volume

TASK, ROBOT = TaskParams(terrain=False, max_steps=600), RobotParams()
SHAPE = Shape(width=16, heads=2, blocks=2, attention=True, stubs=True, floor=True)


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
        mark(senses.grid, seen, np.zeros((pose == k).sum(), dtype=int), row[pose == k], col[pose == k])
        np.testing.assert_array_equal(seen, batch.seen)
    batch.close()


def test_the_same_beams_see_the_same_cells_as_in_the_environment(world):
    compare_sight(world, 300)


def test_a_mine_with_heights_is_refused_by_its_folder(tmp_path):
    steep = load_world(build_volume(BOX, tmp_path))
    with pytest.raises(ValueError, match=f"{steep.folder}: its floor is not flat, want a mine without heights"):
        Senses(steep, TASK, ROBOT)


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
    moving = replace(context, still_s=0.0, held_s=2.0)
    assert keeps_goal(situation, moving) == (situation.present >= 0)
    assert not keeps_goal(situation, replace(context, still_s=0.0, held_s=6.0))
    assert not keeps_goal(situation, replace(context, still_s=5.5, held_s=5.5))


def test_shares_of_squares_are_those_counted_cell_by_cell(world):
    sim = explored(world, robots=1, seconds=10.0)
    own = sim.planners[0].map
    places = random_poses(world, 40)[:, :2]
    empty = OwnMap(own.cell_m)
    ground = GroundAbout([own, *[empty, own] * 20][: len(places)])
    places[0] = own.low * own.cell_m - 100.0  # beyond the map
    for half in (0, 1, 3):
        for number, (place, found) in enumerate(zip(places, ground.shares(places, half).T, strict=True)):
            if number % 2:  # on the empty map
                np.testing.assert_array_equal(found, [1, 0, 0])
                continue
            (row,), (col,) = own.at(place[None], own.cell_m)
            cells = [(row + i, col + j) for i in range(-half, half + 1) for j in range(-half, half + 1)]
            inside = [(i, j) for i, j in cells if 0 <= i < own.seen.shape[0] and 0 <= j < own.seen.shape[1]]
            middle = [own.fine[i * FINE + FINE // 2, j * FINE + FINE // 2] for i, j in inside]
            known, rock = sum(m != UNKNOWN for m in middle), sum(m == ROCK for m in middle)
            seen = sum(own.seen[cell] for cell in inside)
            np.testing.assert_allclose(found, [1 - known / len(cells), seen / len(cells), rock / len(cells)])


def test_floor_speeds_are_measured_where_robots_drive_ahead_only():
    floor, both = FloorSpeeds(TASK, 2), np.array([0, 1])
    floor.begin(both, np.zeros((2, 2)))
    step_m = TASK.max_forward_mps * TASK.control_s
    for k in range(1, 26):  # one drives ahead on mud, one turns on the spot
        floor.note(both, np.array([[0.7 * step_m * k, 1.0], [0.0, 0.0]]), np.array([1.0, 0.1]))
    assert len(floor.of(1)) == 0
    np.testing.assert_allclose(floor.of(0)[1], [0.7 * step_m * 20, 1.0, 0.7])
    assert len(floor.of(0)) == 2
    floor.begin(np.array([0]), np.zeros((1, 2)))
    assert len(floor.of(0)) == 0


def test_a_network_sees_how_slow_the_floor_near_each_goal_is(world):
    sim = explored(world, robots=1, seconds=10.0)
    situation, context = sim.planners[0].look_around(sim.poses[0, :2]), sim.context(0)
    assert np.median(context.floor[:, 2]) == pytest.approx(1.0, abs=0.05)  # the task has no terrain
    goals = situation.graph.places[situation.goals]
    slow = replace(context, floor=np.column_stack([goals, np.linspace(0.4, 1.0, len(goals))]))
    scene = describe(situation, slow)
    told = dict(zip(NAMES, scene.tokens.T, strict=True))
    np.testing.assert_allclose(told["floor_at_goal"], np.linspace(0.4, 1.0, len(goals))[scene.clusters], rtol=1e-6)
    np.testing.assert_allclose(told["floor_known"], 0.0, atol=1e-6)
    assert (told["floor_here"] == 1.0).all()
    np.testing.assert_allclose(told["slow_path"], told["path"] * (1 + 1 / told["floor_at_goal"]) / 2, rtol=1e-5)
    assert (told["firmer_west"] == 0.0).all()  # the last measurement was on dry floor
    slower = replace(slow, floor=np.vstack([slow.floor, [*context.pose[:2], 0.7]]))
    west = describe(situation, slower).tokens[:, NAMES.index("firmer_west")]
    ahead = np.clip((context.pose[0] - goals[scene.clusters, 0]) / 20.0, -1.0, 1.0)
    np.testing.assert_allclose(west, 0.3 * ahead, rtol=1e-5)


def test_fresh_ground_is_worth_more_and_way_less():
    tokens = np.zeros((3, len(NAMES)))
    tokens[:, NAMES.index("first_turn_cos")] = 1.0
    tokens[1, NAMES.index("unknown")] = 1.0
    tokens[2, NAMES.index("path")] = 0.5
    assert fresh_ground(tokens).tolist() == [0.0, 25.0, -10.0]


def test_credits_are_what_a_robot_sees_later_than_the_others_of_its_mine():
    seen = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [20.0, 40.0]])
    found = credits(seen, discount_s=1e9)  # nothing is discounted: what is still to come
    typical = seen[-1].mean() / 3 * 1e9 / 5
    np.testing.assert_allclose(found * typical, [[-10, 10], [-15, 15], [-20, 20]], atol=1e-4)
    assert (credits(seen, discount_s=1.0)[0] > 0).tolist() == [True, False]  # 40 cells after 10 s count nothing


def drawn(world, network=None, robots=3):
    sim = MapSimulator(world, TASK, ROBOT, robots)
    return sample(sim, network or Network(None, SHAPE), 20.0, np.random.default_rng(0))


def test_an_episode_holds_each_decision_with_its_chance_and_credit(world):
    decisions = drawn(world)
    count = len(decisions.chosen)
    assert count > 10
    assert decisions.scenes.tokens.shape == (count, MOST, len(NAMES))
    assert decisions.scenes.real[np.arange(count), decisions.chosen].all()
    assert (decisions.log_chance <= 0).all()
    assert np.isfinite(decisions.credit).all()
    assert decisions.credit.std() > 0
    assert 0 < decisions.share <= 1
    again = drawn(world)
    np.testing.assert_array_equal(decisions.chosen, again.chosen)
    twice = join([decisions, again])
    assert len(twice.chosen) == len(twice.scenes.real) == 2 * count
    assert twice.share == decisions.share


@pytest.mark.parametrize("changes", [{}, {"attention": False}, {"stubs": False}, {"floor": False}, {"blocks": 0}])
def test_the_network_is_the_same_in_torch_and_in_numpy(changes):
    torch = pytest.importorskip("torch", reason="torch comes with `make setup-baselines`")
    from baselines.graph.training.learner import Learner

    shape, rng = SHAPE.model_copy(update=changes), np.random.default_rng(0)
    learner = Learner(shape, 0)
    network, arrays = learner.network, learner.arrays()
    assert {name: array.shape for name, array in arrays.items()} == array_shapes(shape)
    tokens, apart = rng.normal(size=(7, len(NAMES))).astype(np.float32), rng.uniform(0, 60, (7, 7)).astype(np.float32)
    filled = [np.zeros((1, MOST, len(NAMES)), np.float32), np.ones((1, MOST, MOST), np.float32)]
    filled[0][0, :7], filled[1][0, :7, :7] = tokens, apart
    real = torch.arange(MOST)[None] < 7
    theirs = network(*(torch.from_numpy(array) for array in filled), real)[0][0].detach().numpy()
    np.testing.assert_allclose(scores(arrays, shape, tokens, apart), theirs[:7], atol=1e-5)
    assert (theirs[7:] < -1e8).all()


def random_scenes(count):
    rng = np.random.default_rng(0)
    tokens = rng.normal(size=(count, MOST, len(NAMES))).astype(np.float32)
    return Scenes(tokens, np.full((count, MOST, MOST), 10, np.float32), np.ones((count, MOST), dtype=bool))


def test_the_network_imitates_scores_and_values():
    pytest.importorskip("torch", reason="torch comes with `make setup-baselines`")
    from baselines.graph.training.learner import Learner

    scenes = random_scenes(400)
    logits = 2.0 * scenes.tokens[..., NAMES.index("unknown")]
    credit = scenes.tokens[..., NAMES.index("time_left")].mean(axis=1)
    learner = Learner(SHAPE, 0)
    settings = compose_settings(["start.steps=300", "start.batch=64", "start.lr=0.003"]).start
    divergence = learner.imitate(scenes, logits, credit, settings)
    assert divergence < 0.1
    found = scores(learner.arrays(), SHAPE, scenes.tokens[0], scenes.apart_m[0])
    assert found.argmax() == logits[0].argmax()


def test_the_policy_gradient_learns_which_choices_bring_more():
    torch = pytest.importorskip("torch", reason="torch comes with `make setup-baselines`")
    from baselines.graph.training.learner import Learner

    scenes, rng = random_scenes(512), np.random.default_rng(0)
    worth = scenes.tokens[..., NAMES.index("unknown")]
    learner, settings = Learner(SHAPE, 0), compose_settings(["improve.batch=128", "improve.lr=0.001"]).improve
    reached = []
    for update in range(12):
        with torch.no_grad():
            chances = learner.network(*map(torch.from_numpy, (scenes.tokens, scenes.apart_m, scenes.real)))[0]
            chances = chances.log_softmax(dim=1).numpy()
        chosen = (chances + rng.gumbel(size=chances.shape)).argmax(axis=1)
        each = np.arange(len(chosen))
        credit = worth[each, chosen]
        reached.append(float(credit.mean()))
        decisions = Decisions(scenes, chosen, chances[each, chosen], credit.astype(np.float32), 0.0)
        figures = learner.improve(decisions, settings, update)
    assert abs(reached[0]) < 0.2
    assert reached[-1] > reached[0] + 0.5  # a uniform choice brings 0, the best one 1.8
    assert figures["decisions"] == 512


def test_a_learner_goes_on_from_its_file_as_if_it_had_not_stopped(tmp_path):
    pytest.importorskip("torch", reason="torch comes with `make setup-baselines`")
    from baselines.graph.training.learner import Learner

    scenes, settings = random_scenes(64), compose_settings([]).improve
    decisions = Decisions(scenes, np.zeros(64, int), np.full(64, -1.0, np.float32), np.arange(64, dtype=np.float32), 0)
    first = Learner(SHAPE, 0)
    first.improve(decisions, settings, 1)
    first.save(tmp_path / "state.safetensors")
    second = Learner(SHAPE, 0)
    second.load(tmp_path / "state.safetensors")
    for learner in (first, second):
        learner.improve(decisions, settings, 2)
    for name, array in first.arrays().items():
        np.testing.assert_array_equal(array, second.arrays()[name], err_msg=name)
    (tmp_path / "state.safetensors").write_bytes(b"nothing")
    with pytest.raises(BaselineError, match="not the state of this run"):
        second.load(tmp_path / "state.safetensors")


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
    free = replace(context, still_s=0.0, held_s=10.0)
    arrays, scene = random_arrays(SHAPE), describe(situation, free)
    best = scene.clusters[scores(arrays, SHAPE, scene.tokens, scene.apart_m).argmax()]
    assert LearnedChoice(arrays, SHAPE)(situation, free) == best


def test_training_refuses_mines_that_policies_are_judged_by(world, monkeypatch, tee):
    gymnasium.register("MineXplore/Judged-v0", "minexplore.envs.env:MineEnv", kwargs={"world": str(tee.bundle)},
                       vector_entry_point="minexplore.envs.vector:MineVectorEnv")  # fmt: skip
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
        ("improve.caves=2", "improve.caves = 2"),
        ("nothing=1", "nothing"),
    ],
)
def test_settings_that_cannot_be_are_refused(override, message):
    with pytest.raises(BaselineError, match=message):
        compose_settings([override])


def test_a_run_is_resumed_where_it_ended_and_its_policy_is_found_by_name(tmp_path, monkeypatch, short_id):
    pytest.importorskip("torch", reason="torch comes with `make setup-baselines`")
    from baselines.graph.training import train
    from baselines.policies import policy_lookup as policies

    monkeypatch.setattr(train, "built_ids", lambda split, count: [short_id] * count)
    small = [
        "name=small",
        "mines=2",
        "watched=1",
        "jobs=1",
        "start.mines=1",
        "start.robots=2",
        "start.steps=5",
        "start.batch=8",
    ]
    small += ["improve.updates=1", "improve.mines=1", "improve.robots=2", "improve.batch=8", "improve.watch_every=1"]
    settings = compose_settings([*small, "network.width=16", "network.heads=2"])
    run = train.Run(tmp_path / settings.label, settings)
    file = train.train(run)
    networks = [run.network(update) for update in (0, 1)]
    first = {path: path.stat().st_mtime_ns for path in networks}
    longer = settings.model_copy(update={"improve": settings.improve.model_copy(update={"updates": 2})})
    again = train.Run(tmp_path / settings.label, longer)
    assert train.train(again) == file
    assert {path: path.stat().st_mtime_ns for path in networks} == first  # nothing was done twice
    assert again.done == 2
    lines = [json.loads(line) for line in (run.path / "progress.jsonl").read_text().splitlines()]
    seen = {line["update"]: line["watched"] for line in lines if "watched" in line}
    assert sorted(seen) == [0, 1, 2]
    best = max(seen, key=lambda update: (seen[update], update))
    assert file.read_bytes() == again.network(best).read_bytes()
    monkeypatch.setattr(policies, "TRAINED", tmp_path)
    assert make_policy(settings.label, 1, TASK, ROBOT).path == file
    other = settings.model_copy(update={"seed": 7})
    with pytest.raises(BaselineError, match="holds a run of other settings"):
        train.Run(tmp_path / settings.label, other)
