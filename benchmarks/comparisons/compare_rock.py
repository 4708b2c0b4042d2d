"""Compare kinds of rock on the present plan, beside flat walls and white noise: shape, roughness, scores, size."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
from shapely import Polygon

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import run_benchmark
from minexplore.bundle import MODEL, WALLS, GeomGroup
from minexplore.bundle import ROOF as ROOFS
from pipeline.compose import compose
from pipeline.metrics.rock.published import REAL_SWEEP
from pipeline.metrics.rock.relief import STEEP_DEG, Relief, line_factor
from pipeline.metrics.rock.texture import AXES, published_score, strict_score
from pipeline.mjcf.loading import read_spec
from pipeline.mjcf.render import render_from
from pipeline.mjcf.visible import compile_visible
from pipeline.params.config import Config
from pipeline.params.reading.composed import root_overrides
from pipeline.proof.surface import drifts_of, level_rock, relief_of, split_long
from pipeline.proof.texture import MeasuredTexture, measure_flat_texture, measure_texture
from pipeline.store.codecs import decode
from pipeline.store.files import write_atomically
from pipeline.store.hashing import sha256_bytes
from pipeline.store.manifest import code_sha256
from pipeline.surface.build import build_rough_surface, chunk_files, lay_rough_lattice
from pipeline.surface.chunks import cut_chunks
from pipeline.surface.mesh.displacement import displaced
from pipeline.surface.mesh.lattice import ROOF, WALL
from pipeline.surface.reference import measure_sources, measure_sweeps
from pipeline.surface.relief_source import choose_relief
from pipeline.types import DriftNetwork, FreeSpace, Image, Mesh, SolidExtent

STEEP = "steep spectrum"
_DRAWN = ("published_score", STEEP, "andesite")
AS_SWEEPS = "andesite as the sweeps"
ROCKS = {
    "published_score": ["rock=published_score"],
    STEEP: [
        "rock=published_score",
        "surface.published.wavelength_m=[0.4, 0.8, 1.5, 2.8, 4.0]",
        "surface.published.wall_sd_m=[0.006, 0.016, 0.04, 0.09, 0.12]",
        "surface.published.roof_sd_m=[0.01, 0.025, 0.06, 0.12, 0.14]",
        "surface.rough.spacing_m=0.15",
        "surface.rough.roof_spacing_m=0.15",
    ],
    "andesite": ["rock=andesite"],
    AS_SWEEPS: ["rock=andesite", "surface.reference=sweeps"],
    **{name: [f"rock={name}"] for name in ("coal", "limestone", "sandstone")},
}
RESULTS = Path("artifacts/benchmarks/rock.json")
WORLD = Path("artifacts/realism/world")
TABLE, PICTURE = Path("docs/evidence/parts/rock.md"), Path("docs/rock.jpg")
WORLD_VIEW = Path("artifacts/validation/views.png")  # its left half is from the same place
_NOISE_M = 0.05
_SIZE = (900, 600)


def measure(walls: np.ndarray, roof: np.ndarray, free: Polygon, network: DriftNetwork, params: Config) -> dict:
    """Measure the triangles (n, 3, 3) m of walls and roof."""
    drifts = drifts_of(free, network)
    found = measure_texture(walls, roof, drifts, params.validation.texture)
    return figures_of(found, relief_of(walls, roof, drifts, params.validation.texture.stretches), params)


def figures_of(found: MeasuredTexture, relief: Relief, params: Config) -> dict[str, Any]:
    """Return the rows of the table."""
    published, strict = published_score(found.as_paper), strict_score(found.as_is)
    cut = relief.cut["at_100_cm"]
    return {
        **{
            f"area steeper than {least} deg to the plan's wall": relief.steep_share[f"above_{least}_deg"]
            for least in STEEP_DEG
        },
        "- steeper than 40 deg, below 0.5 m": relief.steep_share_by_height["from_0_cm_to_50_cm"]["above_40_deg"],
        "- steeper than 40 deg, 0.5 to 1.5 m": relief.steep_share_by_height["from_50_cm_to_150_cm"]["above_40_deg"],
        "area in flat faces": relief.flat_face_share,
        "wall cut at 1 m / plan's wall": cut.length_ratio,
        **{f"spectrum's slope, {octave.replace('_', ' ')}": v for octave, v in cut.slope.items()},
        **{
            f"Rq / published scan, {r.window_m:g} m": r.rq_m / real.rq_m
            for r in found.sweep
            for real in REAL_SWEEP
            if r.window_m == real.window_m
        },
        **{f"Rq of a line {window.replace('_', ' ')}, mm": 1000 * v for window, v in cut.line_rq_m.items()},
        "Rq of a line / sweeps, typical factor": line_factor(cut.line_rq_m, measure_sweeps(params.surface.sweeps)),
        "published score": published.overall,
        **{f"- {axis.title}": published.axes[name] for name, axis in AXES.items()},
        "strict score": strict.overall,
    }


def build(name: str, free: Polygon, network: DriftNetwork, height_m: float) -> tuple[dict[str, Any], dict[str, Mesh]]:
    """Build one kind of rock, and return its figures and its chunks."""
    params = compose([*root_overrides(), *ROCKS[name]])
    surface = params.surface
    sources = measure_sources(surface)
    start = time.perf_counter()
    lattice = lay_rough_lattice(surface, free, network, height_m)
    rough = build_rough_surface(surface, lattice, choose_relief(surface, sources, lattice))
    size = sum(len(data) for data in chunk_files(rough, surface).values())
    seconds = time.perf_counter() - start
    mesh = rough.mesh
    walls, roof = (mesh.vertices[mesh.faces[mesh.piece == piece]] for piece in (WALL, ROOF))
    cost = {"faces": len(mesh.faces), "meshes, MB": size / 1e6, "seconds to build": seconds}
    chunks = cut_chunks(rough, surface.rough.tile_m, surface.texture.repeat_m, True)
    return measure(walls, roof, free, network, params) | cost, chunks


def build_witness(name: str, free: Polygon, network: DriftNetwork, height_m: float) -> dict[str, Any]:
    """Measure walls that are no rock: the smooth surface of the world, or points that each move by themselves."""
    params = compose([*root_overrides(), "rock=andesite"])
    texture = params.validation.texture
    if name == "flat":  # as stage 6 measures it
        visible = compile_visible(read_spec(WORLD / MODEL), WORLD / MODEL)
        rock = level_rock(visible, free, network)
        walls, roof = (split_long(rock.smooth(piece)) for piece in (WALLS, ROOFS))
        relief = relief_of(walls, roof, rock.drifts, texture.stretches)
        return figures_of(measure_flat_texture(rock, texture), relief, params)
    lattice = lay_rough_lattice(params.surface, free, network, height_m)
    noise = np.random.default_rng(1).normal(0, _NOISE_M, len(lattice.vertices))
    vertices = displaced(lattice, noise)
    wall_faces, roof_faces = (vertices[lattice.faces[lattice.piece == piece]] for piece in (WALL, ROOF))
    return measure(wall_faces, roof_faces, free, network, params)


def draw(chunks: dict[str, Mesh], network: DriftNetwork) -> np.ndarray:
    """Render the chunks from a third of the longest drift, lit from the camera."""
    spec = mujoco.MjSpec()
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.15] * 3, [0.8] * 3
    spec.visual.global_.offwidth, spec.visual.global_.offheight = _SIZE
    spec.visual.map.znear = 0.001
    floor = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[900, 900, 1], rgba=[0.25, 0.2, 0.16, 1])
    floor.group = GeomGroup.FLOOR
    for name, mesh in chunks.items():
        normals = mesh.normals if mesh.normals is not None else np.zeros((0, 3))
        spec.add_mesh(
            name=name,
            uservert=mesh.vertices.ravel(),
            usernormal=normals.ravel(),
            userface=mesh.faces.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        geom = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, rgba=[0.6, 0.5, 0.42, 1])
        geom.group = GeomGroup.ROUGH_SURFACE
    line = np.array(max(network.legs, key=lambda leg: leg.length_m).stations_m)
    at = len(line) // 3
    ahead = line[min(at + 8, len(line) - 1)]
    eye, towards = np.array([*line[at], 1.3]), np.array([*ahead, 1.3])
    groups = GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE
    return render_from(spec.compile(), [(eye, towards)], 70.0, _SIZE, groups)[0]


def table(results: dict[str, dict[str, float]]) -> str:
    """Return the figures as Markdown, a column for each kind."""
    names = list(results)
    rows = list(dict.fromkeys(row for figures in results.values() for row in figures))
    cells = ((row, *(f"{results[n][row]:.3g}" if row in results[n] else "-" for n in names)) for row in rows)
    return markdown_table(["", *names], cells)


def _view(name: str) -> Path:
    """Return the file of a kind's view."""
    return RESULTS.with_name("_".join(["rock", *name.split(" ")]) + ".png")


def main() -> int:
    """Measure the kinds that are not yet measured for this plan and code, and write the table and the picture."""
    source = Path("artifacts/contours/free_space.geojson")
    free = decode(source, FreeSpace).polygon
    network = decode(Path("artifacts/contours/topology.json"), DriftNetwork)
    height_m = decode(Path("artifacts/compile3d/extent.json"), SolidExtent).height_m
    params = [compose([*root_overrides(), *overrides]).model_dump_json() for overrides in ROCKS.values()]
    code = [code_sha256(stage, Path.cwd()) for stage in ("surface", "validation")]
    key = sha256_bytes(source.read_bytes() + "".join([*params, *code]).encode())
    earlier = json.loads(RESULTS.read_text()) if RESULTS.is_file() else {}
    results = earlier["results"] if earlier.get("key") == key else {}
    for name in ("flat", "white noise", *ROCKS):
        if name in results and (name not in _DRAWN or _view(name).is_file()):
            continue  # an interrupted run continues with the next kind
        print(f"compare-rock: {name}", flush=True)
        if name in ROCKS:
            results[name], chunks = build(name, free, network, height_m)
            if name in _DRAWN:
                write_atomically(_view(name), cv2.imencode(".png", draw(chunks, network))[1].tobytes())
        else:
            results[name] = build_witness(name, free, network, height_m)
        write_atomically(RESULTS, json.dumps({"key": key, "results": results}, indent=2).encode())
    text = table({name: results[name] for name in ("flat", "white noise", *ROCKS)})
    write_table(TABLE, text)
    views = {name: cv2.imread(str(_view(name))) for name in _DRAWN}
    views["the default world"] = decode(WORLD_VIEW, Image)[:, : _SIZE[0]]
    small = [cv2.resize(view, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA) for view in views.values()]
    for picture, name in zip(small, views, strict=True):
        cv2.putText(picture, name, (12, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (235, 235, 235), 1, cv2.LINE_AA)
    square = cv2.vconcat([cv2.hconcat(small[:2]), cv2.hconcat(small[2:])])
    write_atomically(PICTURE, cv2.imencode(".jpg", square, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes())
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("compare-rock", main))
