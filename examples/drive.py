"""Drive a robot through the default mine and write a picture of what it sees: `python examples/drive.py`.

It needs the wheel and its extra `examples`.
"""

import argparse

import gymnasium
import imageio.v3 as imageio
import numpy as np

# %% Make the environment. The package before the colon registers it.
parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--steps", type=int, default=300, help="control steps of 0.1 s")
parser.add_argument("--out", default="drive.png", help="the picture")
arguments, _ = parser.parse_known_args()
env = gymnasium.make("minexplore:MineXplore/ChileanMine-v0", render_mode="rgb_array")

# %% Drive towards where the beams of the front half reach farthest; be slow before walls.
observation, info = env.reset(seed=0)
beams = env.unwrapped.task.beams
bearing = (np.arange(beams) * 2 * np.pi / beams + np.pi) % (2 * np.pi) - np.pi
front = np.abs(bearing) < 1.2
for _ in range(arguments.steps):
    ranges = observation[:beams]
    turn = np.average(bearing[front], weights=ranges[front] ** 3 + 1e-6)
    speed = 4 * ranges[np.abs(bearing) < 0.6].min()
    action = np.array([np.clip(speed, 0.05, 1), np.clip(1.5 * turn, -1, 1)], dtype=np.float32)
    observation, reward, terminated, truncated, info = env.step(action)
    if truncated:
        break
print(f"coverage {100 * info['coverage']:.2f} %, {info['collisions']} collisions")

# %% Write the picture.
imageio.imwrite(arguments.out, env.render())
env.close()
