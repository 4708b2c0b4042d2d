"""Train PPO of Stable-Baselines3 in many copies of a mine: `python examples/train_sb3.py`.

It needs the wheel and its extra `sb3`.
"""

import argparse
import sys

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--steps", type=int, default=200_000, help="of all robots together")
parser.add_argument("--robots", type=int, default=64)
parser.add_argument("--world", help="a bundle's folder; without it the default mine's entrance")
parser.add_argument("--out", default="ppo_mine", help="where the policy is saved")
arguments = parser.parse_args()

try:
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor
except ImportError:
    print("train_sb3: Stable-Baselines3 is not installed; run `pip install 'stable-baselines3>=2.6'`", file=sys.stderr)
    sys.exit(2)

from minexplore.extra.sb3 import MineVecEnv

# All robots step in one call; MineVecEnv is the vector environment under the interface of Stable-Baselines3.
made = (
    ("MineXplore/World-v0", {"world": arguments.world})
    if arguments.world
    else ("MineXplore/ChileanMineEntrance-v0", {})
)
env = VecMonitor(MineVecEnv(made[0], arguments.robots, **made[1]))
model = PPO("MlpPolicy", env, n_steps=128, batch_size=1024, seed=0, verbose=1)
model.learn(arguments.steps)
model.save(arguments.out)
env.close()
