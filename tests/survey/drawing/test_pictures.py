"""Plans as pictures: PDF pages, inverted plans, line drawings, crops, rotations, georeferences, occupancy grids."""

import cv2
import numpy as np
import pyproj
import pytest
import rasterio
import shapely
import yaml
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from PIL import Image as Pillow
from rasterio.transform import from_origin

from minesurveys.pictures.pages import open_page
from minesurveys.pictures.paper_scale import ratio_in
from pipeline.errors import GeometryError, InputError
from pipeline.geometry.drawing.line_drawing import fill_line_drawing
from pipeline.geometry.rasterize import fill_polygon
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import GridSurveyParams, PlanSurveyParams
from pipeline.survey.detect import detect_survey
from pipeline.survey.drawing.picture import turn_picture
from pipeline.survey.load import read_survey, sources
from stages.contours import trace_free_space
from tests.mines import RING, TEE, frame_for, plan_of


@pytest.fixture(scope="module")
def tracing(config):
    return config.contours.model_copy(update={"tolerance_m": 0.0, "bridge_m": 0.0, "despeck_m": 0.0})


def plan_params(image, px_per_m=8.0, source="stated", **more):
    scale = {"source": source, "px_per_m": px_per_m if source == "stated" else None}
    return PlanSurveyParams(kind="plan", name="m", image=f"data/{image}", max_megapixels=50, scale=scale, **more)


def traced_from(params, tracing):
    reading = read_survey(params)
    return trace_free_space(tracing, reading)["free_space"].polygon, reading.survey


def overlap(one, other):
    """Return the IoU of two shapes after their south-west corners are aligned."""
    west, south, _, _ = one.bounds
    moved = shapely.transform(other, lambda p: p + np.array([west, south]) - np.array(other.bounds[:2]))
    return one.intersection(moved).area / one.union(moved).area


def write_png(path, picture):
    cv2.imwrite(str(path), picture)


def test_a_pdf_page_is_rendered_at_its_scale(data, tracing):
    figure = Figure(figsize=(10, 7))  # 1:200 on paper, so 200 dpi are 39.37 px/m
    axis = figure.add_axes((0, 0, 1, 1))
    axis.fill(*np.array(TEE.exterior.coords).T / 200 / 0.0254, color="black", lw=0)
    axis.set(xlim=(-1, 19), ylim=(-2, 12), aspect="equal")
    axis.axis("off")
    figure.savefig(data / "plan.pdf")
    per_m = 200 * 10 / 20 / 200 / 0.0254  # the axes show 20 inches on 10
    traced, _ = traced_from(plan_params("plan.pdf", per_m, dpi=200), tracing)
    assert overlap(traced, TEE) > 0.985
    with pytest.raises(InputError, match=r"survey\.page = 2: the document has 1 pages"):
        read_survey(plan_params("plan.pdf", per_m, page=2))
    with pytest.raises(InputError, match="the limits are 16384 px a side"):
        read_survey(plan_params("plan.pdf", per_m, dpi=1200))


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif"])
def test_light_workings_on_dark_paper_are_inverted(data, tracing, suffix):
    frame = frame_for(TEE)
    write_png(data / f"plan{suffix}", 255 - plan_of(TEE, frame))
    traced, _ = traced_from(plan_params(f"plan{suffix}", light_on_dark=True), tracing)
    assert overlap(traced, TEE) > 0.99
    with pytest.raises(GeometryError, match="is the plan inverted"):
        traced_from(plan_params(f"plan{suffix}"), tracing)


def test_a_line_drawing_is_filled_to_the_middle_of_its_walls(data, tracing):
    frame = frame_for(RING, px_per_m=16.0)  # the middle of a wall is one pixel wide, which is an error of half a pixel
    picture = np.full((frame.height_px, frame.width_px, 3), 255, np.uint8)
    for ring in (RING.exterior, *RING.interiors):
        points = np.round(frame.to_image(np.array(ring.coords)) - 0.5).astype(np.int32)
        cv2.polylines(picture, [points], True, (0, 0, 0), 3)
    write_png(data / "plan.png", picture)
    seed = tuple(frame.to_image(np.array([[1.0, 1.0]]))[0])
    traced, _ = traced_from(plan_params("plan.png", 16.0, line_drawing=True, seeds_px=[seed]), tracing)
    assert overlap(traced, RING) > 0.985
    assert len(traced.interiors) == 1


@pytest.mark.parametrize("framed", [False, True])
def test_without_seeds_walls_are_counted_from_the_edge_and_a_border_line_is_not_a_wall(framed):
    frame = frame_for(RING)
    picture = np.zeros((frame.height_px, frame.width_px), np.uint8)
    for ring in (RING.exterior, *RING.interiors):
        points = np.round(frame.to_image(np.array(ring.coords)) - 0.5).astype(np.int32)
        cv2.polylines(picture, [points], True, 1, 2)
    if framed:
        cv2.rectangle(picture, (5, 5), (frame.width_px - 6, frame.height_px - 6), 1, 2)
    truth = fill_polygon(RING, frame)
    filled = fill_line_drawing(picture.astype(bool), [], 2.0)
    assert (filled & truth).sum() / (filled | truth).sum() > 0.97


def test_rotation_adds_no_workings():
    dark = np.full((100, 160, 3), 40, np.uint8)
    dark[:20] = 255
    turned, _ = turn_picture(dark, 30.0)
    assert abs(int((turned[..., 0] < 128).sum()) - 80 * 160) < 300


def test_a_gap_in_a_drawn_wall_is_closed_or_reported():
    lines = ~fill_polygon(shapely.box(0, 0, 20, 10).buffer(-0.5), frame_for(shapely.box(0, 0, 20, 10)))
    lines &= fill_polygon(shapely.box(0, 0, 20, 10), frame_for(shapely.box(0, 0, 20, 10)))
    lines[:, 100:104] = False
    assert fill_line_drawing(lines, [(60.0, 60.0)], 6.0).any()
    with pytest.raises(GeometryError, match="a wall has a gap wider than"):
        fill_line_drawing(lines, [(60.0, 60.0)], 0.0)
    with pytest.raises(GeometryError, match=r"\(9999, 0\) lies beyond"):
        fill_line_drawing(lines, [(9999.0, 0.0)], 6.0)


def test_a_plan_is_cropped_rotated_and_cleaned_of_a_colour(data, tracing):
    frame = frame_for(TEE, margin_m=10)
    picture = plan_of(TEE, frame)
    centre = frame.width_px / 2, frame.height_px / 2
    tilted = cv2.warpAffine(
        picture, cv2.getRotationMatrix2D(centre, 7.0, 1.0), picture.shape[1::-1], borderValue=(255,) * 3
    )
    tilted[::40] = (90, 110, 90)  # grid lines, nearly grey
    sheet = np.zeros((tilted.shape[0] + 60, tilted.shape[1] + 60, 3), np.uint8)
    sheet[30:-30, 30:-30] = tilted
    write_png(data / "plan.png", sheet)
    ignored = [{"rgb": (90, 110, 90), "within": 12}]
    box = (30, 30, sheet.shape[1] - 30, sheet.shape[0] - 30)
    params = plan_params("plan.png", crop_px=box, turn_deg=-7.0, ignore_colours=ignored)
    traced, survey = traced_from(params, tracing.model_copy(update={"bridge_m": 0.2}))
    assert overlap(traced, TEE) > 0.97
    assert survey.georeference.turned_deg == -7.0


@pytest.mark.parametrize("turned_deg", [0.0, 12.0])
def test_a_world_file_gives_the_scale_and_the_origin(data, tracing, turned_deg):
    frame = frame_for(TEE)
    size, angle = 0.125, np.radians(turned_deg)
    cos, sin = np.cos(angle), np.sin(angle)
    a, d, b, e = size * cos, size * sin, size * sin, -size * cos
    corner = np.array([5000.0, 7000.0])
    first = corner + np.array([a + b, d + e]) / 2
    write_png(data / "plan.png", plan_of(TEE, frame))
    (data / "plan.pgw").write_text("\n".join(map(str, (a, d, b, e, *first))))
    params = plan_params("plan.png", source="georeference")
    assert sources(params) == ["data/plan.png", "data/plan.pgw"]
    traced, survey = traced_from(params, tracing)
    assert survey.scale.px_per_m == pytest.approx(8.0)
    origin = frame.origin_col, frame.origin_row  # the mine's origin in the picture
    there = corner + np.array([a * origin[0] + b * origin[1], d * origin[0] + e * origin[1]])
    truth = shapely.transform(TEE, lambda p: p @ np.array([[cos, sin], [-sin, cos]]) + there)
    here = shapely.transform(traced, lambda p: p + np.array(survey.georeference.origin))
    assert here.intersection(truth).area / here.union(truth).area > (0.99 if turned_deg == 0 else 0.97)


def test_a_geotiff_gives_the_scale_the_coordinate_system_and_the_origin(data, tracing):
    frame = frame_for(TEE)
    grey = plan_of(TEE, frame)[..., 0]
    with rasterio.open(
        data / "plan.tif",
        "w",
        driver="GTiff",
        width=grey.shape[1],
        height=grey.shape[0],
        count=1,
        dtype="uint8",
        crs="EPSG:32719",
        transform=from_origin(381_000, 6_290_500, 0.125, 0.125),
    ) as out:
        out.write(grey, 1)
    traced, survey = traced_from(plan_params("plan.tif", source="georeference"), tracing)
    assert overlap(traced, TEE) > 0.99
    assert survey.georeference.crs == "EPSG:32719"
    assert survey.georeference.origin == pytest.approx((381_000, 6_290_500 - grey.shape[0] / 8))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 3", "expected six finite numbers, got 3"),
        ("a\n" * 6, "not six numbers"),
        ("1\n0\n0\n-2\n0\n0", "they must be square"),
        ("1\n0\n0\n1\n0\n0", "not mirrored"),
        ("nan\n" * 6, "six finite numbers"),
    ],
)
def test_a_faulty_world_file_is_refused(data, text, message):
    write_png(data / "plan.png", plan_of(TEE, frame_for(TEE)))
    (data / "plan.pgw").write_text(text)
    with pytest.raises(InputError, match=f"plan.pgw: .*{message}"):
        read_survey(plan_params("plan.png", source="georeference"))


def write_map(data, polygon, yaw_rad=0.0, **more):
    frame = frame_for(polygon, px_per_m=10.0)
    free = fill_polygon(polygon, frame)
    options = {"negate": 0, "mode": "trinary", **more}
    light = free if not options["negate"] else ~free
    grey = np.where(light, 254, 0).astype(np.uint8)
    if options["mode"] == "raw":
        grey = np.where(free, 0, 100).astype(np.uint8)
    write_png(data / "map.pgm", grey)
    south_west = frame.to_mine(np.array([[0, frame.height_px]]))[0]
    fields = {
        "image": "map.pgm",
        "resolution": 0.1,
        "origin": [*map(float, south_west), yaw_rad],
        "occupied_thresh": 0.65,
        "free_thresh": 0.25,
        **options,
    }
    (data / "map.yaml").write_text(yaml.safe_dump(fields))
    return GridSurveyParams(kind="grid", name="m", map="data/map.yaml"), south_west


@pytest.mark.parametrize("more", [{}, {"negate": 1}, {"mode": "scale"}, {"mode": "raw"}])
def test_an_occupancy_grid_keeps_the_position_of_its_map(data, tracing, more):
    params, _ = write_map(data, TEE, **more)
    traced, survey = traced_from(params, tracing)
    assert (
        traced.intersection(TEE).area / traced.union(TEE).area > 0.99
    )  # without alignment, because the mine frame is the map's frame
    assert survey.scale.source == "map"
    assert sources(params) == ["data/map.yaml", "data/map.pgm"]


def test_a_rotated_grid_is_rotated_about_its_own_origin(data, tracing):
    params, corner = write_map(data, TEE, yaw_rad=0.4)
    traced, _ = traced_from(params, tracing)
    truth = shapely.affinity.rotate(TEE, 0.4, origin=tuple(corner), use_radians=True)
    assert traced.intersection(truth).area / traced.union(truth).area > 0.97


def test_points_choose_among_disconnected_workings(data, config):
    two = shapely.union_all([shapely.box(0, 0, 60, 5), shapely.box(0, 12, 30, 17)])
    write_png(data / "plan.png", plan_of(two, frame_for(two)))
    params = plan_params("plan.png", origin_px=(31.5, 167.5), entrance_m=(3.0, 14.0))
    plain = config.contours.model_copy(update={"tolerance_m": 0.0})
    areas = []
    for parts in ("largest", "spawn", [(2.0, 14.0), (20.0, 14.0)]):
        areas.append(traced_from(params, plain.model_copy(update={"components": parts}))[0].area)
    assert [round(a) for a in areas] == [300, 150, 150]
    for parts, message in (
        ([(2.0, 14.0), (2.0, 2.0)], r"are 7\.\d\d m away from those"),
        ([(2.0, 60.0)], "no workings at"),
    ):
        with pytest.raises(GeometryError, match=message):
            traced_from(params, plain.model_copy(update={"components": parts}))


def test_licences_come_from_the_registry(data):
    write_png(data / "plan.png", plan_of(TEE, frame_for(TEE)))
    (data / "registry.txt").write_text(f"plan.png\t{'0' * 64}\t1\tour own survey\tCC-BY-4.0\n")
    assert read_survey(plan_params("plan.png")).survey.licences == {"data/plan.png": "CC-BY-4.0"}


def test_a_warning_states_which_page_of_a_pdf_is_read(data, capsys):
    with PdfPages(data / "plan.pdf") as pages:
        for width in (4, 5):
            figure = Figure(figsize=(width, 3))
            figure.add_axes((0.2, 0.4, 0.6, 0.2)).set_facecolor("black")
            pages.savefig(figure)
    assert read_survey(plan_params("plan.pdf", page=2)).plan.shape[:2] == (600, 1000)
    assert "plan.pdf: page 2 of 2 is read; --page states another" in capsys.readouterr().err


@pytest.mark.parametrize(("inches", "dpi"), [((10, 7), 200), ((49, 56), 120), ((300, 300), 36)])
def test_the_resolution_of_a_page_is_lowered_until_it_fits_and_said(tmp_path, capsys, inches, dpi):
    path = write_page(tmp_path / "plan.pdf", inches)
    with open_page(path, 1) as page:
        assert page.fitting_dpi() == dpi
    warned = capsys.readouterr().err
    assert warned == ("" if dpi == 200 else warned)
    assert (f"page of {inches[0]} x {inches[1]} in; it is read at {dpi} dpi; --dpi" in warned) == (dpi < 200)


def test_the_system_beside_a_world_file_states_its_unit(data, capsys):
    cv2.imwrite(str(data / "plan.png"), plan_of(TEE, frame_for(TEE)))
    foot_m = 1200 / 3937
    (data / "plan.pgw").write_text(f"{0.125 / foot_m}\n0\n0\n{-0.125 / foot_m}\n6300000\n1850000\n")
    (data / "plan.png.aux.xml").write_text(f"<PAMDataset><SRS>{pyproj.CRS('EPSG:2230').to_wkt()}</SRS></PAMDataset>")
    assert detect_survey(data / "plan.png").values["scale"]["px_per_m"] == pytest.approx(8.0 * foot_m)
    assert "plan.png.aux.xml states a coordinate system, which is not read" in capsys.readouterr().err
    (data / "plan.prj").write_text(pyproj.CRS("EPSG:2230").to_wkt("WKT1_ESRI"))
    found = detect_survey(data / "plan.png")
    assert found.values["scale"]["px_per_m"] == pytest.approx(8.0, rel=1e-3)
    assert [file.name for file in found.files[-2:]] == ["plan.pgw", "plan.prj"]
    (data / "plan.prj").write_text(pyproj.CRS("EPSG:4326").to_wkt("WKT1_ESRI"))
    with pytest.raises(InputError, match=r"its pixels are in degrees .*; warp it .*, or state --px-per-m"):
        detect_survey(data / "plan.png")
    assert detect_survey(data / "plan.png", StatedOptions(px_per_m=8.0)).values["scale"]["source"] == "stated"


def test_a_value_in_pixels_of_a_page_whose_resolution_is_lowered_needs_the_resolution(
    tmp_path, capsys
):  # capsys: the child may not write
    path = write_page(tmp_path / "plan.pdf", (49, 56))
    with pytest.raises(InputError, match=r"--px-per-m depends on the resolution; state --dpi too, 120 or less fits"):
        detect_survey(path, StatedOptions(px_per_m=20.0))


def write_page(path, inches):
    Figure(figsize=inches).savefig(path)
    return path


def test_the_first_frame_of_a_gif_is_read_as_the_same_picture_in_png(data, capsys):
    frame = frame_for(TEE)
    first = plan_of(TEE, frame)
    frames = [Pillow.fromarray(first[..., ::-1]), Pillow.new("RGB", first.shape[1::-1], "white")]
    frames[0].save(data / "plan.gif", save_all=True, append_images=frames[1:])
    write_png(data / "plan.png", first)
    found = [detect_survey(data / name, StatedOptions(px_per_m=frame.px_per_m)) for name in ("plan.gif", "plan.png")]
    assert found[0].width_m == pytest.approx(found[1].width_m, rel=0.02)
    assert found[0].values["kind"] == "plan"
    assert "plan.gif: the first of 2 pages is read" in capsys.readouterr().err
    (data / "cut.gif").write_bytes((data / "plan.gif").read_bytes()[:60])
    with pytest.raises(InputError, match=r"cut\.gif: (the GIF is broken|not a picture)"):
        detect_survey(data / "cut.gif", StatedOptions(px_per_m=1.0))


def write_sheet(path, text, ratio=500, dpi=100):
    """Write a PDF of a cross of drifts at 1:`ratio` with a text beside it."""
    figure = Figure(figsize=(8, 6))
    axis = figure.add_axes((0, 0, 1, 1))
    metres = 0.0254 * ratio
    axis.set(xlim=(-5, 8 * metres - 5), ylim=(-25, 6 * metres - 25))
    axis.axis("off")
    axis.fill(*np.array(TEE.exterior.coords).T, color="black", lw=0)
    axis.text(0, -15, text)
    figure.savefig(path)
    return path


@pytest.mark.parametrize("text", ["Scale 1:500", "1 : 500", "SCALE 1:500 (A4)"])
def test_the_scale_that_a_pages_text_states_is_taken_where_there_is_no_bar(data, text):
    path = write_sheet(data / "plan.pdf", text)
    found = detect_survey(path, StatedOptions(dpi=150))
    assert found.values["scale"]["px_per_m"] == pytest.approx(150 / 0.0254 / 500)
    assert found.remarks["scale"].startswith("1:500 by the text of the page")


def test_a_page_with_several_scales_is_asked_about_and_the_option_states_one(data):
    path = write_sheet(data / "plan.pdf", "Plan 1:500, section 1:100")
    with pytest.raises(InputError, match=r"no scale bar found; state --px-per-m, --scale 1:N of the paper"):
        detect_survey(path, StatedOptions(dpi=150))
    found = detect_survey(path, StatedOptions(dpi=150, ratio=500))
    assert found.values["scale"]["px_per_m"] == pytest.approx(150 / 0.0254 / 500)


def test_the_scale_of_a_scan_follows_from_its_ratio_and_the_resolution_that_it_states(data):
    picture = Pillow.fromarray(plan_of(TEE, frame_for(TEE)))
    picture.save(data / "plan.png", dpi=(300, 300))
    found = detect_survey(data / "plan.png", StatedOptions(ratio=1500))
    assert found.values["scale"]["px_per_m"] == pytest.approx(300 / 0.0254 / 1500, rel=1e-3)
    picture.save(data / "bare.png")
    with pytest.raises(InputError, match=r"--scale needs the resolution of the scan, which the picture does not state"):
        detect_survey(data / "bare.png", StatedOptions(ratio=1500))


@pytest.mark.parametrize(
    ("text", "ratio"),
    [
        ("Scale 1:2500", 2500),
        ("1 : 2 500", 2500),
        ("1:1,000 on A1", 1000),
        ("at 11:500", None),
        ("1:1", None),
        ("12:1:500", None),
        ("1:500 and again 1:500", 500),
        ("1:500, 1:1000", None),
        ("", None),
    ],
)
def test_one_ratio_is_read_from_a_text(text, ratio):
    assert ratio_in(text) == ratio
