"""One change for each row of docs/reference/extending.md: the files that it writes or edits, its test among them."""

from __future__ import annotations

import re
from pathlib import Path

from tests.project import ROOT

PAGE = ROOT / "docs/reference/extending.md"
Change = dict[str, str | list[tuple[str, str]]]
"""File -> its text if it is new, else (text, what replaces it once) of each edit."""


OBSTACLES = '''"""A list of a world's collision parts."""


def obstacle_table(count: int) -> str:
    return f"parts\\n{count}\\n"
'''


def blocks(title: str, language: str = "python") -> list[str]:
    """Return the blocks of a language in a section of the page."""
    section = PAGE.read_text().split(f"\n## {title}\n")[1].split("\n## ")[0]
    return re.findall(rf"^```{language}\n(.*?)^```", section, flags=re.M | re.S)


def _without_last_line(block: str) -> str:
    """Return a block without the line that registers what it defines."""
    return block.rstrip("\n").rpartition("\n")[0].rstrip() + "\n"


def _after(anchor: str, line: str) -> tuple[str, str]:
    return anchor, f"{anchor}{line}"


def changes() -> dict[str, Change]:
    """Return the change of each row of the page's table, by its first cell."""
    metric = blocks("A metric with a limit")[0]
    measure = metric[metric.index("def steepest_grade") : metric.index("def drive")].rstrip() + "\n"
    return {
        "a survey format": {
            "minesurveys/vector/wkt.py": _without_last_line(blocks("A survey format")[0]).replace(
                "from minesurveys.formats import FileKind, Format\n", ""
            ),
            "minesurveys/formats.py": [
                _after(
                    "FORMATS: dict[str, Format] = {\n",
                    '    ".wkt": Format(FileKind.VECTOR, shapes="minesurveys.vector.wkt:read_wkt"),\n',
                )
            ],
            "benchmarks/fuzzing/samples.py": [
                _after("Files]] = {\n", '    "wkt": lambda: {"m.wkt": b"POLYGON ((0 0, 60 0, 60 5, 0 5, 0 0))\\n"},\n')
            ],
            "benchmarks/tables/statements.csv": [
                _after(
                    "format,states,outcome,how,test\n",
                    ".wkt,nothing,used,They are metres.,tests/survey/test_wkt.py::test_a_line_of_text_is_a_drift\n",
                )
            ],
            "tests/survey/test_wkt.py": """
from benchmarks.fuzzing.readers import READERS
from benchmarks.fuzzing.samples import SAMPLES
from benchmarks.tables.reference import STATEMENTS
from pipeline.survey.detect import detect_survey


def test_a_line_of_text_is_a_drift(tmp_path):
    (name, data), *_ = SAMPLES["wkt"]().items()
    (tmp_path / name).write_bytes(data)
    assert detect_survey(tmp_path / name).values["kind"] == "vector"
    assert "wkt" in READERS
    assert f"tests/survey/test_wkt.py::{test_a_line_of_text_is_a_drift.__name__}" in STATEMENTS.read_text()
""",
        },
        "a metric with a limit": {
            "pipeline/metrics/drive.py": '"""How hard a mine is to drive."""\n\nimport numpy as np\n\n'
            f"from pipeline.types import DriftNetwork\n\n\n{measure}",
            "pipeline/proof/validator.py": [
                (
                    "from pipeline.metrics.iou",
                    "from pipeline.metrics.drive import steepest_grade\nfrom pipeline.metrics.iou",
                ),
                (
                    "MEASURES: dict",
                    "def _drive(found: Validator) -> dict[str, Any]:\n"
                    "    frame = np.array(found.world.record.T_world_mine)\n"
                    '    return {"steepest_grade": steepest_grade(found.network, frame)}\n\n\nMEASURES: dict',
                ),
                ('    "world": _world,\n', '    "world": _world,\n    "drive": _drive,\n'),
            ],
            "conf/validation/default.yaml": [_after("\nlimits:\n", "  drive: {steepest_grade: {max: 0.10}}\n")],
            "tests/metrics/test_drive.py": """
from pipeline.compose import compose
from pipeline.proof.groups import applying_limits, is_measured
from pipeline.proof.validator import MEASURES


def test_the_metric_is_measured_and_its_limit_applies():
    params = compose([]).validation
    assert is_measured("drive", params) and "drive" in MEASURES
    assert applying_limits(params, {})["drive.steepest_grade"].max == 0.10
""",
        },
        "an explorer": {
            "baselines/explorers/longest_beam.py": _without_last_line(blocks("An explorer")[0]).replace(
                "from baselines.explorers import EXPLORERS, Explorer\n", ""
            ),
            "baselines/explorers/__init__.py": [
                _after(
                    "from baselines.explorers.frontier import InformationGain, NearestFrontier\n",
                    "from baselines.explorers.longest_beam import LongestBeam\n",
                ),
                _after("EXPLORERS: dict[str, Explorer] = {\n", '    "longest-beam": Explorer(LongestBeam),\n'),
            ],
            "docs/reference/benchmark.md": [
                ("| `random` |", "| `longest-beam` | drives along the longest beam |\n| `random` |")
            ],
            "baselines/tests/test_longest_beam.py": """
import pytest

from baselines.policies.policy_lookup import known_sha256, make_policy
from minexplore.task import TaskParams


@pytest.mark.parametrize("heights", [False, True])
def test_the_explorer_is_known_by_its_name(heights):
    assert type(make_policy("longest-beam", 1, TaskParams(), heights=heights)).__name__ == "LongestBeam"
    assert known_sha256("longest-beam", heights)
""",
        },
        "another robot, other kinematics": {
            "tests/minexplore/test_tracked.py": blocks("Another robot")[0]
            + """

def test_tracks_lose_a_part_of_a_turn():
    slow, fast = (TrackedRobot(turn_share=share).controls(np.zeros(1), np.ones(1)) for share in (0.5, 1.0))
    assert (2 * slow == fast).all()
""",
        },
        "a floor zone": {
            "conf/realism/default.yaml": [
                _after(
                    "rgba: [0.52, 0.45, 0.38, 1.0]}\n",
                    "  - {name: grit, friction: 0.8, command_scale: 0.9, "
                    "speed_noise_mps: 0.0, rgba: [0.4, 0.4, 0.4, 1.0]}\n",
                )
            ],
            "tests/test_grit.py": """
from pipeline.compose import compose


def test_the_world_has_the_zone():
    assert [zone.name for zone in compose([]).realism.zones][:2] == ["dry", "grit"]
""",
        },
        "a texture axis": {
            "pipeline/metrics/rock/texture.py": [
                (
                    "# From the text files of the paper's",
                    "def mean_height_m(walls: np.ndarray) -> float:\n    return float(walls[:, 2].mean())\n\n\n"
                    "# From the text files of the paper's",
                ),
                _after(
                    "AXES: dict[str, Axis] = {\n",
                    '    "mean_height_m": Axis("mean height", lambda rock: mean_height_m(rock.walls), 1.75),\n',
                ),
            ],
            "conf/validation/default.yaml": [_after("    published: {", "mean_height_m: {min: 0.5}, ")],
            "tests/metrics/test_mean_height.py": """
import numpy as np

from pipeline.compose import compose
from pipeline.metrics.rock.texture import RockPoints, measure_axes, strict_score, sweep_walls
from pipeline.proof.texture import TextureReport
from pipeline.report.results import ROWS


def test_the_axis_is_measured_scored_listed_and_limited():
    points = np.random.default_rng(0).uniform(0, 3.5, (2000, 3))
    figures = measure_axes(RockPoints(points, sweep_walls(points), points, None))
    assert strict_score(figures).axes["mean_height_m"] > 0.99
    assert "- mean height, strict" in [row.title for row in ROWS]
    assert compose([]).validation.limits["texture.published.mean_height_m"].min == 0.5
""",
        },
        "a collision method": {
            "pipeline/geometry/rock/decompose.py": [
                (
                    "DECOMPOSERS: dict",
                    "def hull_decomposer(height_m: float) -> Decomposer:\n"
                    "    return lambda tile: [extrude_polygon(tile.convex_hull, height_m).vertices]\n\n\n"
                    "DECOMPOSERS: dict",
                ),
                ('{"coacd": coacd_decomposer', '{"hull": hull_decomposer, "coacd": coacd_decomposer'),
            ],
            "pipeline/params/compile3d.py": [
                (
                    "CollisionParams = ",
                    'class HullParams(Params):\n    """One hull a tile."""\n\n    method: Literal["hull"]\n'
                    "    tiles: int = Field(ge=1, le=10000)\n\n\nCollisionParams = ",
                ),
                ("| VhacdParams,", "| VhacdParams | HullParams,"),
            ],
            "conf/collision/hull.yaml": "# @package compile3d.collision\nmethod: hull\ntiles: 4\n",
            "tests/geometry/test_hull.py": """
import shapely

from pipeline.compose import compose
from stages.compile3d import collision_parts


def test_the_method_gives_a_hull_a_tile():
    config = compose(["collision=hull"])
    assert config.validation.collision_method == config.realism.made_by.collision_method == "hull"
    assert len(collision_parts(config.compile3d, [shapely.box(0, 0, 40, 40)], (0, 0, 40, 40))) == 4
""",
        },
        "a sensor": {
            "minexplore/sensors/kinds/barometer.py": blocks("A sensor")[0],
            "tests/minexplore/sensors/test_barometer.py": """
from minexplore.sensors.page import sensors_section
from minexplore.sensors.table import sensor_names


def test_the_sensor_is_a_choice_and_has_a_row():
    assert "barometer" in sensor_names()
    assert "| `barometer` | (1,) float32 |" in sensors_section()
""",
        },
        "an observation": {
            "tests/minexplore/test_with_tilt.py": blocks("An observation")[0]
            + """

def test_the_wrapper_states_its_space():
    assert issubclass(WithTilt, gymnasium.Wrapper)
""",
        },
        "a camera or renderer": {
            "minexplore/pictures/render.py": [
                ('CAMERAS = ("chase"', 'CAMERAS = ("side", "chase"'),
                (
                    'camera = self._behind(data, body) if name == "chase"',
                    "views = {'side': self._beside, 'chase': self._behind}\n        "
                    "camera = views[name](data, body) if name in views",
                ),
                (
                    "    def _ahead(self",
                    "    def _beside(self, data: mujoco.MjData, body: int) -> mujoco.MjvCamera:\n"
                    "        camera = self._behind(data, body)\n        camera.azimuth += 90\n        return camera\n\n"
                    "    def _ahead(self",
                ),
            ],
            "minexplore/envs/env.py": [('`"front"` from the robot, or', '`"side"`, `"front"` from the robot, or')],
            "docs/reference/environment.md": [
                ('`"front"` from the robot, or', '`"side"`, `"front"` from the robot, or')
            ],
            "tests/minexplore/test_side.py": """
from minexplore.envs.env import MineEnv
from minexplore.pictures.render import CAMERAS


def test_the_camera_is_a_choice_and_described():
    assert "side" in CAMERAS
    assert '"side"' in (MineEnv.__doc__ or "")
""",
        },
        "a look": {
            "minexplore/looks.py": [
                _after("    PLAIN: Look(ambient=0.3, diffuse=0.45),\n", '    "lit": Look(0.5, 0.5),\n')
            ],
            "conf/look/lit.yaml": (ROOT / "conf/look/dry.yaml").read_text().replace("look: dry", "look: lit"),
            "tests/mjcf/test_lit.py": """
from pipeline.compose import compose
from pipeline.schema import record


def test_the_look_is_a_choice_that_a_record_may_state():
    assert compose(["look=lit"]).realism.look == "lit"
    assert "lit" in str(record.LOOKS)
""",
        },
        "an output of stage 5": {
            "pipeline/mjcf/obstacles.py": OBSTACLES,
            "stages/realism.py": [
                (
                    "from pipeline.params.realism",
                    "from pipeline.mjcf.obstacles import obstacle_table\nfrom pipeline.params.realism",
                ),
                (
                    'return {"world": assemble_world(params, mine.survey, **inputs)}',
                    "world = assemble_world(params, mine.survey, **inputs)\n"
                    '    return {"obstacles": obstacle_table(len(world)), "world": world}',
                ),
                (
                    'return {"world": bundle_volume(params, mine.survey, free_space, compiled, rock)}',
                    "world = bundle_volume(params, mine.survey, free_space, compiled, rock)\n"
                    '    return {"obstacles": obstacle_table(len(world)), "world": world}',
                ),
                ("-> dict[str, Bundle]:", "-> dict[str, Any]:"),
                ("-> dict[str, Bundle]:", "-> dict[str, Any]:"),
                ('writes={"world"', 'writes={"obstacles": Artifact("realism/obstacles.csv", str), "world"'),
            ],
            "tests/mjcf/test_obstacles.py": """
from pipeline.mjcf.obstacles import obstacle_table
from stages.realism import STAGE


def test_stage_5_writes_the_table():
    assert STAGE.writes["obstacles"].path == "realism/obstacles.csv"
    assert obstacle_table(3) == "parts\\n3\\n"
""",
        },
    }


def apply(change: Change, folder: Path) -> None:
    """Write the files of a change into a copy of the project.

    Raises
    ------
    ValueError
        If a file lacks the text that an edit replaces.
    """
    for name, content in change.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, str):
            path.write_text(content)
            continue
        text = path.read_text()
        for old, new in content:
            if old not in text:
                raise ValueError(f"{name}: no {old!r}")
            text = text.replace(old, new, 1)
        path.write_text(text)
