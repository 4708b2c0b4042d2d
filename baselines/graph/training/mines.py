"""The mines that the graph explorer is trained in, as simulators; those that policies are judged by are refused."""

from __future__ import annotations

from baselines.base.environments import make_env, require_trainable
from baselines.base.errors import BaselineError
from baselines.graph.training.simulator import MapSimulator

REPLAN_STEPS = 30  # control steps between plans in training; 15, as in the environment, take 1.5 times the time


def make_simulator(env_id: str, robots: int) -> MapSimulator:
    """Return a simulator to train in.

    Raises
    ------
    BaselineError
        If the mine is one that policies are judged by, or has heights.
    """
    require_trainable(env_id)
    return simulate(env_id, robots, REPLAN_STEPS)


def simulate(env_id: str, robots: int, replan_steps: int = 15) -> MapSimulator:
    """Return a simulator of any mine, for comparison with the environment.

    Raises
    ------
    BaselineError
        If there is no such mine, or it has heights.
    """
    env = make_env(env_id, 1)
    try:
        return MapSimulator(env.world, env.task, env.robot, robots, replan_steps)
    except ValueError as error:
        raise BaselineError(f"{env_id}: {error}") from error
    finally:
        env.close()
