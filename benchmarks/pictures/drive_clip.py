"""Record ten seconds of a robot in the embedded mine as an animated picture, docs/drive.gif, by OSMesa."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "osmesa")

import gymnasium
import numpy as np
from PIL import Image

import minexplore  # noqa: F401  (registers the environments)
from minexplore.__main__ import ahead
from pipeline.store.files import write_atomically

CLIP = Path("docs/drive.gif")
_ENV = "MineXplore/ChileanMineEntrance-v0"
_STEPS_PER_S = 10  # of the task's control; each is a frame
_WARM_UP, _FRAMES = 40, 100  # after four seconds the robot drives at full speed
_SIZE_PX, _COLOURS = (384, 288), 160


def record() -> list[np.ndarray]:
    """Return the frames (rows, cols, 3) RGB behind a robot that drives where its beams reach farthest."""
    env = gymnasium.make(_ENV, render_mode="rgb_array", camera="chase")
    observation, _ = env.reset(seed=0)
    frames: list[np.ndarray] = []
    for step in range(_WARM_UP + _FRAMES):
        observation, *_ = env.step(ahead(observation))
        if step >= _WARM_UP:
            frames.append(np.asarray(env.render()))
            if len(frames) % 20 == 0:
                print(f"drive-clip: {len(frames)} of {_FRAMES} frames", flush=True)
    env.close()
    return frames


def main() -> int:
    """Record the clip and print its size."""
    pictures = [Image.fromarray(frame).resize(_SIZE_PX, Image.Resampling.LANCZOS) for frame in record()]
    palette = Image.fromarray(np.vstack([np.asarray(picture) for picture in pictures[::5]])).quantize(
        _COLOURS, kmeans=8
    )
    few = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    data = io.BytesIO()
    few[0].save(
        data, "GIF", save_all=True, append_images=few[1:], duration=1000 // _STEPS_PER_S, loop=0, optimize=False
    )
    write_atomically(CLIP, data.getvalue())
    print(f"drive-clip: {CLIP}, {len(few)} frames, {len(data.getvalue()) / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
