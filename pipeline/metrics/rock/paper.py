"""The values that the paper states, under the names of our metrics."""

from __future__ import annotations

from pipeline.metrics.rock.texture import AXES

PAPER: dict[str, float | str] = {
    "iou.free_space_vs_cleaned": 0.9538,
    "navigability.blocked": "none",
    "topology.loops_world": 1,
    "areas.tunnel_m2": 104_423,  # the rock outside its tunnel
    "areas.islands_m2": 14_577,
    "collision.parts": 1_186,
    **{f"texture.published.{name}": axis.paper_score for name, axis in AXES.items() if axis.paper_score is not None},
    "texture.published.overall": 0.794,
    "texture.strict.overall": "about 0.29",  # our strict score of their model
    "texture.bump_ratio": round((AXES["bump_rq_m"].paper_model or 0.0) / AXES["bump_rq_m"].real, 2),
    "world.bytes": "about 800",
    "world.first_load_s": "< 10",
    "world.load_s": "< 10",
    "world.lights": 33,
    "world.tilt_deg": 5.0,
    "world.gain_entrance_region_m": 5.2,
}
