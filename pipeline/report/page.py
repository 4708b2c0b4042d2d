"""The report: one HTML page with all evidence about a world; it needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import jinja2
import numpy as np
from matplotlib.figure import Figure
from pydantic import TypeAdapter

from minexplore import __version__
from pipeline.mjcf.bundle import read_record
from pipeline.params.validation import Limit, ValidationParams
from pipeline.report.chart import Chart, ChartGrid
from pipeline.report.figure_rows import figures_of, places_of
from pipeline.report.figures.mine import draw_mine, mine_chart, to_svg
from pipeline.report.figures.scene import scene_page
from pipeline.report.figures.style import to_image
from pipeline.report.meanings import DOCS, meaning_of
from pipeline.report.remarks import remarks_of
from pipeline.report.results import read_metrics
from pipeline.store.codecs import decode, encode
from pipeline.store.files import replace_folder
from pipeline.store.manifest import REPORT_FILES, read_manifest
from pipeline.store.mine_survey import open_survey
from pipeline.types import DriftNetwork, FreeSpace, Image, Survey

FOLDER, PAGE = "report", "report.html"
_STAGES = ("survey", "contours", "compile3d", "surface", "realism", "validation")
_WIDTH, _QUALITY = 1400, 82  # px and JPEG quality of the pictures in the page
# file below the world's folder, caption
_PLAN = [
    ("survey/mine/plan.png", "The plan as read."),
    ("contours/evidence/contours.png", "Traced contours: outer walls green, islands red, the drift network amber."),
]
_GLANCE = [
    (
        "validation/evidence/agreement.png",
        "World from above against the survey: green where both are free, blue where one is.",
    ),
    (
        "validation/evidence/deviation.png",
        "Points of the scan against the world: red in the rock, blue in the free space, yellow where nobody saw it.",
    ),
    ("validation/evidence/views.png", "Views of a robot: along a drift, and at the junction where most drifts meet."),
]
_TEXTURE = [
    ("validation/evidence/texture.png", "The six texture axes of the rock, world against real rock."),
    ("surface/evidence/roughness.png", "Roughness over wavelength."),
    ("surface/evidence/sections.png", "Cross-sections of drifts: the smooth surface, and the rough surface over it."),
    (
        "validation/evidence/heat.png",
        "Roughness along the walls. Storeys of a mine with heights are drawn side by side.",
    ),
]


_MEASURED_AT = ("passages", "centrelines", "stations")  # kinds of survey whose walls are distances from stations


@dataclass(frozen=True)
class LegRow:
    """A row of the page's table of legs: its stations, its length m, and what is known of a volume's.

    `width` and `height` are at either end, m; `known` is how walls, roof and floor are known.
    """

    start: str
    end: str
    length_m: float
    width: str = ""
    height: str = ""
    known: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class WorldView:
    """What of a report depends on what a world is.

    Attributes
    ----------
    record : of `world.json`
    plan : Figure
        For print.
    scene : str
        The 3D view (HTML).
    limits : dict
        Of the metrics.
    chart : Chart
        The map.
    legs : sequence of LegRow
    loops, dead_ends : int
        Numbers of them.
    width : (str, str), optional
        The headline's width and what it is of; None takes the widths of the plan.
    volume : dict, optional
        What of its survey one volume is.
    """

    record: Any
    plan: Figure
    scene: str
    limits: dict[str, Limit]
    chart: Chart
    legs: Sequence[LegRow]
    loops: int
    dead_ends: int
    width: tuple[str, str] | None = None
    volume: dict[str, Any] | None = None


def write_page(root: Path, env_id: str, changed: dict[str, tuple[Any, Any]], view: WorldView | None = None) -> Path:
    """Write the report of a world: `report/report.html`, and its plan as SVG and PNG in print quality.

    Parameters
    ----------
    root : Path
        The world's folder. All six stages must have run; limits may be breached. What was not measured is left out.
    env_id : str
        The Gymnasium id of the world.
    changed : dict
        Parameter to (default, value of this world), where they differ.
    view : WorldView, optional
        Of a world that is one volume; None is a level mine.

    Returns
    -------
    Path
        Path of the page.

    Raises
    ------
    ArtifactError
        If an artifact is missing; the message names it.
    """
    free_space, network = (
        decode(root / "contours/free_space.geojson", FreeSpace),
        _read(root, "contours/topology.json", DriftNetwork),
    )
    survey = open_survey(root / "survey/mine").survey
    view = view or _view(root, survey, free_space, network)
    record, svg = view.record, to_svg(view.plan)
    metrics = read_metrics(root / "validation")
    manifests = [read_manifest(root / stage / "manifest.json") for stage in _STAGES]
    groups = figures_of(metrics, view.limits)
    limited = [figure.holds for group in groups for figure in group[1] if figure.holds is not None]
    source = Path((survey.sources or [survey.name])[0]).name
    template = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    ).get_template("page.html.j2")
    page = template.render(
        name=record.name,
        env_id=env_id,
        record=record,
        version=__version__,
        survey=survey,
        chart=replace(view.chart, places=places_of(groups)),
        script=(Path(__file__).parent / "figures/chart.js").read_text(),
        docs=DOCS,
        remarks=remarks_of(root, manifests, source),
        source=source,
        glance=_pictures(root, ([] if view.volume and view.legs else _PLAN[:1] if view.volume else _PLAN) + _GLANCE),
        texture=_pictures(root, _TEXTURE),
        scene=view.scene,
        groups=groups,
        held=sum(limited),
        limited=len(limited),
        iou=metrics.get("iou.free_space_vs_cleaned"),  # without it stage 6 measured the certificate alone
        certificate=_read(root, "validation/certificate.json", dict),
        replay=_replay(root),
        network=network,
        view=view,
        volume=view.volume,
        width=view.width or _width_of(network, survey),
        is_measured_at_stations=survey.kind in _MEASURED_AT,
        meaning_of=meaning_of,
        manifests=manifests,
        changed=changed,
        inputs={k: v for m in manifests for k, v in m.inputs.items() if k.startswith("data/")},
        bundle="../realism/world",
        tolerance_m=free_space.tolerance_m,
    )
    files = {PAGE: page.encode(), "mine.svg": svg, "mine.png": encode(Path("mine.png"), to_image(view.plan))}
    replace_folder(root / FOLDER, files, REPORT_FILES)
    return root / FOLDER / PAGE


def _view(root: Path, survey: Survey, free_space: FreeSpace, network: DriftNetwork) -> WorldView:
    """Return what the report shows of a level mine."""
    bundle = root / "realism" / "world"
    record = read_record(bundle)
    params = read_manifest(root / "validation" / "manifest.json").params
    scene = scene_page(bundle, record, free_space, network)
    return WorldView(
        record,
        draw_mine(free_space.polygon, network, record, survey.georeference),
        scene,
        TypeAdapter(ValidationParams).validate_python(params).limits,
        mine_chart(free_space.polygon, network, record, ChartGrid.of(survey.georeference)),
        [LegRow(leg.start, leg.end, leg.length_m) for leg in network.legs],
        network.loops,
        len(network.dead_ends),
    )


def _read(root: Path, file: str, kind: Any) -> Any:
    return decode(root / file, kind)


def _pictures(root: Path, pictures: list[tuple[str, str]]) -> list[tuple[str, str, str]]:
    """Return (data URL, caption, full-size file) of each picture that there is; not every mine has all of them."""
    return [
        (_embedded(decode(root / file, Image)), caption, f"../{file}")
        for file, caption in pictures
        if (root / file).exists()
    ]


def _embedded(picture: np.ndarray) -> str:
    if picture.shape[1] > _WIDTH:
        size = (_WIDTH, max(1, round(picture.shape[0] * _WIDTH / picture.shape[1])))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
    return "data:image/jpeg;base64," + base64.b64encode(data).decode()


def _replay(root: Path) -> dict[str, Any] | None:
    """Return the replay of real sweeps with its picture, or None if the survey has no sweeps."""
    folder = root / "validation/evidence"
    if not (folder / "replay.json").exists():
        return None
    return {
        **json.loads((folder / "replay.json").read_text()),
        "picture": _embedded(_read(folder, "replay.png", Image)),
    }


def _width_of(network: DriftNetwork, survey: Survey) -> tuple[str, str]:
    """Return the median clear width of the drifts and what it is of, with the 5 and 95 % quantiles."""
    widths = 2 * np.array([half for leg in network.legs for half in leg.half_width_m])
    low, middle, high = np.quantile(widths, [0.05, 0.5, 0.95])
    of = {
        "centrelines": "typical drift width; it was stated and not measured",
        "passages": "typical drift width; the remarks count the walls that nobody measured",
    }.get(survey.kind, "typical drift width")
    return f"{middle:.2f} m", f"{of} ({low:.2f} to {high:.2f} m)"
