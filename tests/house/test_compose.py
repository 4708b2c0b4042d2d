import re

import pytest
import yaml
from pydantic import ValidationError

from pipeline.compose import compose
from pipeline.errors import ParamsError
from pipeline.metrics.size import FIXED_BYTES, FIXED_LOAD_MB, FIXED_LOAD_S, PARTS_PER_CORNER
from pipeline.params.refusals import describe_refusals
from pipeline.params.validation import ValidationParams
from tests.composed import compose as composed
from tests.project import ROOT


@pytest.fixture(autouse=True)
def _in_the_project(monkeypatch):
    monkeypatch.chdir(ROOT)


def test_the_default_is_the_embedded_survey_with_exact_prisms():
    config = composed([])
    assert (config.survey.kind, config.compile3d.collision.method) == ("stations", "exact")


def test_an_override_changes_one_value_and_nothing_else():
    before, after = (composed(o).model_dump() for o in ([], ["contours.tolerance_m=0.3"]))
    assert after["contours"].pop("tolerance_m") == 0.3
    before["contours"].pop("tolerance_m")
    assert after["validation"].pop("tolerance_m") == 0.3  # stage 6 allows walls to differ by the same
    before["validation"].pop("tolerance_m")
    assert after["realism"]["made_by"].pop("tolerance_m") == 0.3  # and the bundle states it
    before["realism"]["made_by"].pop("tolerance_m")
    assert before == after


@pytest.mark.parametrize("method", ["exact", "coacd", "vhacd"])
def test_the_collision_group_selects_the_method(method):
    assert compose([f"collision={method}"]).compile3d.collision.method == method


def test_the_paper_preset_sets_all_the_papers_choices_and_its_own_limits():
    config = compose(["preset=paper"])
    assert config.survey.resample_width_px == 948
    assert config.survey.scale.px_per_m == 1.36
    collision = config.compile3d.collision
    assert (collision.method, collision.tiles, collision.max_hulls, collision.resolution) == (
        "vhacd",
        70,
        32,
        1_000_000,
    )
    assert config.realism.lights.count == 33
    assert len(config.realism.zones) == 3
    default = composed([]).validation.limits
    assert default["iou.free_space_vs_cleaned"].min == 0.990
    assert config.validation.limits["iou.free_space_vs_cleaned"].min < 0.990


def test_another_mine_has_every_limit_except_those_that_depend_on_the_size_of_the_published_one():
    default, own = (composed(o).validation for o in ([], ["survey=procedural"]))
    assert set(default.limits) - set(own.limits) == {
        "texture.published.overall",
        "texture.published.dominant_wavelength_m",
        *("texture.rq_ratio.at_100_cm", "texture.rq_ratio.at_200_cm"),  # passages bound the relief of rock
        *(f"relief.steep_share_by_height.from_150_cm_up.above_{least}_deg" for least in (20, 40)),  # low walls
        # an error of the walls in metres, and size by metres of wall and area of rock, have limits instead
        "iou.free_space_vs_cleaned",
        "iou.free_space_vs_raw",
        "navigability.blocked_at_wall_share",
        "collision.parts",
        "world.bytes",
        "world.load_s",
        "world.load_memory_mb",
    }
    middle = [f"from_50_cm_to_150_cm.above_{least}_deg" for least in (20, 40)]
    looser = {
        *(f"per_m2.{name}" for name in ("bytes", "load_s", "load_memory_mb")),  # coarser rock may need more
        "texture.bump_ratio",
        "texture.strict.overall",
        *(f"texture.rq_ratio.at_{cm}_cm" for cm in (10, 15, 20, 30, 50)),  # narrow passages bound the relief
        "texture.axes_measured.published",
        "texture.axes_measured.strict",
        "wall_error.max_m",
        "texture.published.roof_irregularity_m",  # narrow drifts; the rock's faces depend on a drift's direction
        *(f"relief.steep_share.above_{least}_deg" for least in (20, 40)),
        *(f"relief.steep_share_by_height.{band}" for band in ("from_0_cm_to_50_cm.above_20_deg", *middle)),
        *(f"relief.cut.at_{cm}_cm.slope.from_100_cm_to_200_cm" for cm in (100, 150)),
    }
    for name, limit in own.limits.items():
        if name not in looser:
            assert limit.max is None or limit.max <= default.limits[name].max, name
            assert limit.min is None or limit.min >= default.limits[name].min, name
    clauses = default.certificate.limits, own.certificate.limits
    assert clauses[0] == clauses[1]


@pytest.mark.parametrize("rock", ["coal", "limestone", "published_score", "sandstone"])
def test_another_rock_keeps_its_limits_in_another_mine(rock):
    published, own = (composed([f"rock={rock}", *more]).validation.limits for more in ([], ["survey=procedural"]))
    groups = ("texture.", "relief.")
    kept, found = ({n: limit for n, limit in all_.items() if n.startswith(groups)} for all_ in (published, own))
    assert found == kept
    assert bool(kept) == (rock == "published_score")  # the others copy no scan


def test_a_limit_by_the_size_of_the_embedded_survey_is_at_least_as_strict_as_its_absolute_one():
    limits, rock_m2, wall_m = composed([]).validation.limits, 18_530.0, 2614.66
    for name, fixed in (("bytes", FIXED_BYTES), ("load_s", FIXED_LOAD_S), ("load_memory_mb", FIXED_LOAD_MB)):
        assert fixed + rock_m2 * limits[f"per_m2.{name}"].max <= limits[f"world.{name}"].max
    corners, pillars = 307, 1
    parts = PARTS_PER_CORNER * corners + pillars + wall_m * limits["collision.parts_per_wall_m"].max
    assert parts <= limits["collision.parts"].max


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("contours.tolerance_m=-1", r"contours\.tolerance_m = -1: .*want at least 0"),
        ("contours.tolerance_m=much", r"contours\.tolerance_m = 'much'"),
        ("contours.tolerance_m=nan", r"contours\.tolerance_m = nan: .*finite"),
        ("contours.tolerence_m=1", r"contours\.tolerence_m: unknown; contours has .*tolerance_m"),
        ("contour.tolerance_m=1", r"unknown; the configuration has .*contours"),
        ("survey=cave", r"survey = cave: valid choices are graded, plan, procedural, stations, variant"),
        ("collision=vhcd", r"collision = vhcd: valid choices are coacd, exact, vhacd"),
        ("survey=1", "survey = 1: valid choices are graded, plan, procedural, stations, variant"),
        ("survey.frame_m=[10,0,-10,5]", "want west < east and south < north"),
        ("survey=plan survey.poses.scale_range_px_per_m=[0,1]", "want 0 < low < high"),
        ("contours.threshold=999", r"contours\.threshold"),
        ("surface.texture.rgb=[999,-4,0]", r"surface\.texture\.rgb"),
        (
            "survey.scale.source=guess",
            r"survey\.scale\.source = 'guess': .*'bar', 'stated', 'poses' or 'georeference'",
        ),
        ("survey.scale.source=stated", "scale.source=stated needs scale.px_per_m"),
        ("survey.stations=/etc/passwd", "not below data/"),
        ("survey.stations=data/../x.csv", "not below data/"),
        ("realism.lights.count=101", r"realism\.lights\.count = 101: .*want at most 100"),
        ("nonsense", "nonsense"),
        ("=1", "^override =1: want KEY=VALUE"),
        ("contours.tolerance_m=[1", r"^override contours\.tolerance_m=\[1: want KEY=VALUE .*lists as \[1,2\]"),
        (
            "contours.tolerance_m=${nope.x}",
            r"contours\.tolerance_m: its value refers to a key that",
        ),
        ("contours.tolerance_m=", r"contours\.tolerance_m"),
        ("+contours.new=1", r"contours\.new = 1: no such key"),
    ],
)
def test_a_wrong_override_is_named_with_its_value_and_the_valid_choices(override, message):
    with pytest.raises(ParamsError, match=message):
        compose(override.split())


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("contours.tolerance_m=-1", "contours.tolerance_m"),  # stage 6 takes all these values too
        ("contours.wall_error_m=-1", "contours.wall_error_m"),
        ("realism.floor.spacing_m=-1", "realism.floor.spacing_m"),
        ("surface.overlay=some", "surface.overlay"),
        ("compile3d.collision.method=vhcd", "compile3d.collision.method"),
        ("survey.poses=3", "survey.poses"),  # stage 2 too
        ("survey=variant", "survey.workings"),
    ],
)
def test_a_refused_value_is_one_line_with_the_key_that_was_written(override, key):
    with pytest.raises(ParamsError) as caught:
        compose([override])
    assert re.match(rf"{re.escape(key)}( =|:)", str(caught.value))
    assert len(str(caught.value).splitlines()) == 1


def test_a_limit_that_only_stage_6_has_on_a_shared_value_names_the_key_that_was_written():
    with pytest.raises(ValidationError) as caught:
        ValidationParams.model_validate({**composed([]).validation.model_dump(), "wall_error_m": 0.0})
    alone = describe_refusals(caught.value, {"wall_error_m": "${contours.wall_error_m}"})
    assert alone.startswith("contours.wall_error_m = 0.0: ")


def test_the_plain_look_has_no_fittings():
    realism = compose(["look=plain"]).realism
    assert (realism.look, realism.floor, realism.furnish) == ("plain", None, "off")


@pytest.mark.parametrize(
    "overrides",
    [
        ["contours.tolerance_m=0.3", "surface=base"],
        ["surface=base", "contours.tolerance_m=0.3"],
        ["contours.tolerence_m=0.3", "surface=base"],
    ],
)
def test_a_wrong_choice_is_named_whatever_the_other_overrides(overrides):
    with pytest.raises(ParamsError, match=r"^surface = base: valid choices are default$"):
        compose(overrides)


def test_configuration_text_is_never_executed():
    with pytest.raises(ParamsError):
        compose(["+contours._target_=os.system"])
    tag = "contours.tolerance_m: !!python/object/apply:os.system ['true']"
    with pytest.raises(yaml.YAMLError):
        yaml.safe_load(tag)


@pytest.mark.parametrize("name", ["andesite", "coal", "limestone", "sandstone"])
def test_a_rock_sets_its_joints_its_mesh_and_its_limits(name):
    config = composed([f"rock={name}"])
    assert config.surface.rock is not None
    assert len(config.surface.rock.sets) == 3
    assert config.surface.rough.kept_share < 0.5
    limits = config.validation.limits
    assert ("texture.rq_ratio.at_50_cm" in limits) == (name == "andesite")  # the others copy no scan
    assert limits["walls.gap_p95_m"] == composed([]).validation.limits["walls.gap_p95_m"]


@pytest.mark.parametrize("value", ["[" * 1000 + "]" * 1000, f"[{','.join(['[1,2]'] * 5000)}]", "\x1b[31m"])
def test_an_override_of_absurd_size_or_depth_is_one_printable_line(value):
    with pytest.raises(ParamsError) as caught:
        compose([f"contours.components={value}"])
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 500
