"""Compare exact prisms, CoACD and V-HACD on the present plan: parts, seconds, errors, step cost."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import shapely

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import run_benchmark
from pipeline.compose import compose
from pipeline.geometry.rock.collision import footprint_errors
from pipeline.geometry.rock.partition import rock_around, world_box
from pipeline.params.reading.composed import root_overrides
from pipeline.store.codecs import decode
from pipeline.store.files import write_atomically
from pipeline.store.hashing import sha256_bytes
from pipeline.store.manifest import code_sha256
from pipeline.types import ConvexParts, FreeSpace, Spawn
from stages.compile3d import collision_parts

METHODS = ("exact", "coacd", "vhacd")
RESULTS = Path("artifacts/benchmarks/collision.json")
TABLE = Path("docs/evidence/parts/compare-collision.md")
_STEPS = 2000


def measure_method(method: str, free_space: FreeSpace, spawn: Spawn) -> dict[str, Any]:
    """Decompose the rock by one method and measure the result."""
    params = compose([*root_overrides(), f"collision={method}"]).compile3d
    free = free_space.polygon
    world = world_box(free, params.rock_margin_m, free_space.frame.extent_m)
    start = time.perf_counter()
    parts = collision_parts(params, rock_around(free, world), world)
    seconds = time.perf_counter() - start
    intrusion, missing = footprint_errors([parts[i] for i in range(len(parts))], free, shapely.box(*world))
    return {
        "parts": len(parts),
        "seconds": seconds,
        "intrusion_m2": intrusion,
        "missing_m2": missing,
        "step_us": step_cost_us(parts, spawn.anchor_m),
    }


def step_cost_us(parts: ConvexParts, start_m: tuple[float, float]) -> float:
    """Return the median time of `mj_step`, us, for a box that is pushed over the floor between the given walls."""
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.005
    floor = [0, 0, 1]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1000, 1000, 1], pos=[0, 0, 0], zaxis=floor)
    for i in range(len(parts)):
        centre = parts[i].mean(axis=0)
        spec.add_mesh(name=f"part_{i}", uservert=(parts[i] - centre).ravel().tolist())
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part_{i}", pos=centre)
    box = spec.worldbody.add_body(pos=[*start_m, 0.3])
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.35, 0.3, 0.2], mass=50.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    blocks = []
    for _ in range(_STEPS // 100):
        data.xfrc_applied[1, :2] = rng.uniform(-400, 400, size=2)
        start = time.perf_counter()
        mujoco.mj_step(model, data, 100)
        blocks.append((time.perf_counter() - start) * 1e4)
    return float(np.median(blocks))


def table(results: dict[str, dict[str, Any]]) -> str:
    """Return the comparison as Markdown."""
    exact = results["exact"]["step_us"]
    titles = ("method", "parts", "seconds", "intrusion, m2", "missing rock, m2", "step, us", "step / exact")
    forms = {"parts": "d", "seconds": ".2f", "intrusion_m2": ".4f", "missing_m2": ".4f", "step_us": ".0f"}
    rows = (
        (method, *(format(r[name], form) for name, form in forms.items()), f"{r['step_us'] / exact:.2f}")
        for method, r in results.items()
    )
    return markdown_table(titles, rows)


def main() -> int:
    """Measure the methods that are not yet measured for this plan, print the table and write it to `docs/`."""
    source = Path("artifacts/contours/free_space.geojson")
    free_space, spawn = decode(source, FreeSpace), decode(Path("artifacts/compile3d/spawn.json"), Spawn)
    params = [compose([*root_overrides(), f"collision={m}"]).compile3d.model_dump_json() for m in METHODS]
    key = sha256_bytes(source.read_bytes() + "".join([*params, code_sha256("compile3d", Path.cwd())]).encode())
    earlier = json.loads(RESULTS.read_text()) if RESULTS.is_file() else {}
    results = earlier["results"] if earlier.get("key") == key else {}
    for method in METHODS:
        if method not in results:  # an interrupted run continues with the next method
            results[method] = measure_method(method, free_space, spawn)
            write_atomically(RESULTS, json.dumps({"key": key, "results": results}, indent=2).encode())
    text = table(results)
    size = f"{free_space.areas.tunnel_m2:,.0f} m2 and {shapely.get_num_coordinates(free_space.polygon)} vertices"
    write_table(TABLE, f"Free space of {size}.\n\n{text}")
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("compare-collision", main))
