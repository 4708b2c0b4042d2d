"""Clone an explorer from its episodes, without a step: `python examples/offline_data.py --data FOLDER`.

It needs the wheel and `pip install "minari[hdf5]"`; `python -m baselines.dataset` in a checkout writes the data.
"""

import argparse
import os
import sys

import gymnasium
import numpy as np

import minexplore  # noqa: F401  (registers the environments)


def features(observations: np.ndarray) -> np.ndarray:
    """Return ranges, their inverses and a constant (n, 33): near rock matters more than far rock."""
    ranges = observations[:, :16]
    return np.hstack([ranges, 1.0 / (0.1 + ranges), np.ones((len(ranges), 1))])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", default="artifacts/datasets")
    parser.add_argument("--dataset", default="minexplore/wall-following-v0")
    parser.add_argument("--world", default="chilean_mine", help="to try the clone in")
    parser.add_argument("--steps", type=int, default=600)
    arguments = parser.parse_args()
    os.environ["MINARI_DATASETS_PATH"] = arguments.data
    try:
        import minari
    except ImportError:
        sys.exit('minari is not installed: pip install "minari[hdf5]"')

    episodes = list(minari.load_dataset(arguments.dataset).iterate_episodes())
    seen = np.vstack([episode.observations[:-1] for episode in episodes])
    done = np.vstack([episode.actions for episode in episodes])
    weights = np.linalg.lstsq(features(seen), done, rcond=None)[0]
    error = np.abs(features(seen) @ weights - done).mean()
    print(
        f"{len(episodes)} episodes, {len(seen):,} steps; the clone is {error:.2f} of the command's range off on average"
    )

    env = gymnasium.make("MineXplore/World-v0", world=arguments.world, max_episode_steps=arguments.steps)
    observation, info = env.reset(seed=0)
    over = False
    while not over:
        command = np.clip(features(observation[None]) @ weights, -1, 1)[0].astype(np.float32)
        observation, _, terminated, truncated, info = env.step(command)
        over = terminated or truncated
    print(f"coverage {100 * info['coverage']:.2f} % after {arguments.steps / 10:g} s, {info['collisions']} collisions")
