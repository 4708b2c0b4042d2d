"""Mines that must come out whole: figures (parts/cases.md), plans (docs/cases.png), views inside (docs/cases.jpg)."""

from __future__ import annotations

import argparse
import json
import resource
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import matplotlib as mpl
import numpy as np
from tqdm import tqdm

from baselines.base.markdown import markdown_table, write_table
from benchmarks.pictures.case_figures import case_figures, drivable_part, read_legs
from minexplore.bundle import GeomGroup
from minexplore.floors.floor import Floor
from pipeline.mjcf.bundle import OpenedBundle, open_bundle
from pipeline.mjcf.render import render_from
from pipeline.store.codecs import decode
from pipeline.survey.passages.relief import floor_of
from pipeline.types import Image, Survey
from tests.heights import UNDER, Roofs, levels, seam, shelves, spiral, table
from tests.project import Project

mpl.use("agg")
import matplotlib.pyplot as plt
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

_PAGE, _PLANS, _VIEWS = Path("docs/evidence/parts/cases.md"), Path("docs/cases.png"), Path("docs/cases.jpg")
_SIZE_PX, _QUALITY, _FOVY_DEG = (600, 400), 80, 75.0
_ROOFS: Roofs = {
    **{f"c{k}{i}": 5.0 for k in range(3) for i in (1, 2)},
    **{f"m{k}{i}": 3.0 for k in range(3) for i in (2, 3)},
}
_MARGIN_M = 8.0
_COLUMNS = (
    *("case", "options", "stations: part, built", "part, m", "left out, m", "sheets", "loops: surveyed, built"),
    *("shafts", "roof, m", "height, cm", "grade, deg", "certificate", "s"),
)
_LIGHT = ("preset=light",)


@dataclass(frozen=True)
class View:
    """A view from a place `ahead_m` from a station towards the next, to a third; heights are over the floor, m."""

    station: str
    follower: str
    ahead_m: float
    eye_m: float
    target: str
    target_m: float


@dataclass(frozen=True)
class Case:
    """A survey, the options of `new`, and the views to draw of it."""

    title: str
    source: str
    half_width_m: float | None = None
    overrides: tuple[str, ...] = ()
    text: str | None = None
    views: tuple[View, ...] = ()

    @property
    def options(self) -> list[str]:
        """Return the options of `new`."""
        return [*([] if self.half_width_m is None else ["--half-width", f"{self.half_width_m:g}"]), *self.overrides]


CASES = {
    "wheal-pell": Case(
        "Wheal Pell, a mine in Cornwall",
        "data/wheal_pell/pell.3d",
        views=(
            View("pell.2025-05-14.33", "pell.2025-05-14.34", 1.0, 1.0, "pell.2025-05-14.34", 0.8),
            View("pell.2025-04-27.12", "pell.2025-04-27.13", 1.0, 1.0, "pell.2025-04-27.13", 0.8),
        ),
    ),
    "sakany": Case(
        "Sakany, a cave",
        "data/sakany/Sakany_nodes.dat",
        1.0,
        views=(View("822", "823", 3.0, 1.5, "823", 1.5), View("834", "835", 1.0, 1.5, "836", 1.5)),
    ),
    "shaft-levels": Case(
        "generated: three levels, a shaft, surveyed roofs of 3 to 5 m",
        "shaft-levels.csv",
        text=table(levels(), roofs=_ROOFS),
        views=(View("m10", "m11", 3.0, 0.9, "m10", 4.0), View("c01", "c02", 2.0, 1.5, "c02", 2.2)),
    ),
    "spiral": Case("generated: spiral decline of three turns", "spiral.csv", None, _LIGHT, table(spiral(3))),
    "seam": Case("generated: room and pillar on a dipping seam", "seam.csv", None, _LIGHT, table(seam())),
    "under": Case("generated: drift under drift", "under.csv", None, _LIGHT, table(UNDER)),
    "shelves": Case("generated: cave with shelves", "shelves.csv", None, _LIGHT, table(shelves())),
}


def build(name: str, project: Project) -> dict[str, Any]:
    """Make a case's world in a copy of the project, if it is not there; return its figures and the seconds it took."""
    case, record = CASES[name], project.folder / f"{name}.json"
    if not record.is_file():
        if case.text is not None:
            (project.folder / case.source).write_text(case.text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "pipeline", "new", name, "--from", case.source, *case.options]
        done = project.run(*command, OMP_NUM_THREADS="1")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode != 0:
            raise SystemExit(f"{name}: {done.stderr}")
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        record.write_text(json.dumps({"seconds": round(seconds)}))
    figures = case_figures(world_of(project, name), project.folder / case.source, case.half_width_m)
    return asdict(figures) | {"seconds": json.loads(record.read_text())["seconds"]}


def world_of(project: Project, name: str) -> Path:
    """Return the folder with the artifacts of a case."""
    return project.folder / "artifacts/worlds" / name


def table_of(rows: dict[str, dict[str, Any]]) -> str:
    """Return the table of docs/evidence/parts/cases.md."""
    return markdown_table(_COLUMNS, (_cells(CASES[name], row) for name, row in rows.items()))


def _cells(case: Case, row: dict[str, Any]) -> list[object]:
    low, high = row["roof_m"]
    options = " ".join(case.options)
    return [
        case.title,
        f"`{options}`" if options else "none",
        f"{row['stations']}, {row['built']}",
        f"{row['length_m']:.0f}",
        f"{row['left_out_m']:.0f}",
        row["sheets"],
        f"{row['loops_surveyed']}, {row['loops_built']}",
        row["shafts"],
        f"{low:g}" if low == high else f"{low:g} to {high:g}",
        f"{100 * row['z_m']:.2f}",
        f"{row['grade_deg']:.3f}",
        "holds" if row["certificate"] else "**broken**",
        row["seconds"],
    ]


def draw_plans(project: Project) -> None:
    """Draw the cases that have views: plan and floor in space, with the survey's lines."""
    shown = {name: case for name, case in CASES.items() if case.views}
    figure = plt.figure(figsize=(11, 4.4 * len(shown)))
    for row, (name, case) in enumerate(shown.items()):
        root, legs = world_of(project, name), read_legs(project.folder / case.source, case.half_width_m)
        survey, floor = decode(root / "survey/survey.json", Survey), decode(root / "compile3d/floor.npz", Floor)
        assert survey.heights is not None
        origin = np.array([*survey.georeference.origin, 0.0])
        moved = np.pad(floor.offset_m, [(0, 0), (0, 1)])[floor.sheet]
        corners = floor.vertices[floor.faces] - moved[:, None] + np.array([0.0, 0.0, survey.heights.datum_m])
        level = corners[:, :, 2].mean(axis=1)
        order = np.argsort(level)  # higher floors cover lower ones
        shade = ScalarMappable(Normalize(level.min(), level.max()), "viridis")
        colours = shade.to_rgba(level[order])
        part = drivable_part(legs)
        driven = [np.array([part.nodes[a]["place"], part.nodes[b]["place"]]) - origin for a, b in part.edges]
        others = [np.column_stack([leg.positions_m, floor_of(leg)]) - origin for leg in legs]
        plan = figure.add_subplot(len(shown), 2, 2 * row + 1)
        space = figure.add_subplot(len(shown), 2, 2 * row + 2, projection="3d")
        for line in others:
            plan.plot(*line[:, :2].T, color="0.6", linewidth=0.5, zorder=1)
            space.plot(*line.T, color="0.6", linewidth=0.5)
        for line in driven:
            plan.plot(*line[:, :2].T, color="r", linewidth=1.0, zorder=1)
        # Edges as well, so that narrow drifts are seen.
        faces: dict[str, Any] = {"facecolors": colours, "edgecolors": colours, "linewidths": 0.8}
        plan.add_collection(PolyCollection(corners[order, :, :2], zorder=2, **faces))
        space.add_collection3d(Poly3DCollection(corners[order], **faces))
        figure.colorbar(shade, ax=plan, label="elevation, m", shrink=0.8)
        (west, south), (east, north) = (f(corners[:, :, :2], axis=(0, 1)) for f in (np.min, np.max))
        plan.set(xlim=(west - _MARGIN_M, east + _MARGIN_M), ylim=(south - _MARGIN_M, north + _MARGIN_M), aspect="equal")
        plan.set_title(f"{case.title} (m)", fontsize=9)
        whole = np.concatenate([*others, *corners])
        times = 2.0 if np.ptp(whole[:, 2]) < 0.2 * np.ptp(whole[:, :2], axis=0).max() else 1.0
        space.set_box_aspect(np.maximum(np.ptp(whole, axis=0) * [1, 1, times], 8))
        space.set_title("folded, with the whole survey" + ("; heights doubled" if times > 1 else ""), fontsize=9)
        space.tick_params(labelsize=6)
    figure.tight_layout()
    figure.savefig(_PLANS, dpi=70)


def draw_views(project: Project) -> None:
    """Draw the views inside the cases, a row each."""
    rows = []
    for name, case in CASES.items():
        if case.views:
            root, legs = world_of(project, name), read_legs(project.folder / case.source, case.half_width_m)
            survey, world = decode(root / "survey/survey.json", Survey), open_bundle(root / "realism/world")
            assert survey.heights is not None
            origin = np.array([*survey.georeference.origin, survey.heights.datum_m])
            place = {key: node["place"] - origin for key, node in drivable_part(legs).nodes.items()}
            rows.append(cv2.hconcat([_look(world, place, view) for view in case.views]))
    cv2.imwrite(str(_VIEWS), cv2.vconcat(rows), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])


def _look(world: OpenedBundle, place: dict[str, np.ndarray], view: View) -> Image:
    """Return a view; stations have their places (3,) m on the floor, in the mine frame."""
    T = np.array(world.record.T_world_mine)
    along = place[view.follower] - place[view.station]
    eye = place[view.station] + view.ahead_m * along / np.linalg.norm(along)
    heights = np.array([[0.0, 0.0, view.eye_m], [0.0, 0.0, view.target_m]])
    eye_m, towards_m = (np.array([eye, place[view.target]]) + heights) @ T[:3, :3].T + T[:3, 3]
    groups = (GeomGroup.FLOOR, GeomGroup.ROUGH_SURFACE)
    return render_from(world.model, eye_m, towards_m, _FOVY_DEG, _SIZE_PX, groups)


def main() -> int:
    """Build the cases, write the page and draw the pictures; return 1 if a certificate does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="build in this folder, and take from it what was built before")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        project = Project.at(folder) if (folder / "conf").is_dir() else Project(folder, tiny=False)
        rows = {name: build(name, project) for name in tqdm(CASES, unit="mine", disable=None)}
        draw_plans(project)
        draw_views(project)
    write_table(_PAGE, table_of(rows))
    print(table_of(rows), end="")
    return 0 if all(row["certificate"] for row in rows.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
