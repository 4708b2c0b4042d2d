"""Published rock texture: the paper's values of the real scan and of its model, and its scores.

From the text files of their repository (Badri1401/MineXplore, commit 3f7fe7c): scan 12M, first 2,000,000 returns.
"""

from __future__ import annotations

from pipeline.metrics.rock.axes import TextureAxes
from pipeline.metrics.rock.planefit import Residuals

REAL = TextureAxes(37.477, 0.055162, 0.149121, 1.75749, 0.128520, 0.010008)
PAPER_MODEL = TextureAxes(26.246, 0.019943, 0.050549, 1.463839, 0.019789, 0.003202)
PAPER_SCORES = TextureAxes(0.9758, 0.8189, 0.7978, 0.9936, 0.5088, 0.7782)
REAL_SWEEP = [
    Residuals(0.10, 0.00338, 0.00566, 0.0353, 0.0103, 0),
    Residuals(0.15, 0.00544, 0.00989, 0.0671, 0.0197, 0),
    Residuals(0.20, 0.00773, 0.01423, 0.0971, 0.0303, 0),
    Residuals(0.30, 0.01382, 0.02504, 0.1710, 0.0569, 0),
    Residuals(0.50, 0.03007, 0.05149, 0.3356, 0.1202, 0),
    Residuals(1.00, 0.08363, 0.12825, 0.7286, 0.2949, 0),
    Residuals(2.00, 0.17567, 0.25373, 1.4727, 0.5523, 0),
]

PAPER: dict[str, float | str] = {  # the values that the paper states, under the names of our metrics
    "iou.free_space_vs_cleaned": 0.9538,
    "navigability.blocked": "none",
    "topology.loops_world": 1,
    "areas.tunnel_m2": 104_423,  # the rock outside its tunnel
    "areas.islands_m2": 14_577,
    "collision.parts": 1_186,
    **{f"texture.published.{axis}": score for axis, score in vars(PAPER_SCORES).items()},
    "texture.published.overall": 0.794,
    "texture.strict.overall": "about 0.29",  # our strict score of their model
    "texture.bump_ratio": round(vars(PAPER_MODEL)["bump_rq_m"] / vars(REAL)["bump_rq_m"], 2),
    "world.bytes": "about 800",
    "world.first_load_s": "< 10",
    "world.load_s": "< 10",
    "world.lights": 33,
    "world.tilt_deg": 5.0,
    "world.gain_entrance_region_m": 5.2,
}
