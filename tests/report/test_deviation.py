"""How far a scan is from its world, as a picture from above and as colours of the 3D view."""

import numpy as np
import pytest
import trimesh

from benchmarks.pictures.look_at_report import find_browser
from pipeline.report.figures.deviation import add_deviation, colours_of, draw_deviation
from pipeline.report.figures.scene import walked_page
from pipeline.report.figures.volume import facet_scene
from pipeline.types import Frame

FIGURES = {"within_5cm": 0.9, "within_10cm": 0.95, "within_30cm": 1.0, "mean_mm": -4.2, "seen_share": 0.5}
NONE = np.zeros((0, 3))
SHOWN = """() => {
  const found = [];
  scene.traverse(o => { if (o.isMesh && o.visible) found.push(o.name); });
  return found;
}"""


@pytest.fixture(scope="module")
def frame():
    return Frame(10.0, 0.0, 300.0, 400, 300)


@pytest.fixture(scope="module")
def box():
    """Return the corners, facets and labels (floor, wall, roof) of a box of 6 x 4 x 3 m."""
    mesh = trimesh.creation.box((6, 4, 3))
    label = np.select([mesh.face_normals[:, 2] < -0.9, mesh.face_normals[:, 2] > 0.9], [0, 2], 1)
    return np.asarray(mesh.vertices) + np.array([3, 2, 1.5]), np.asarray(mesh.faces), label


def floor_points():
    x, y = np.meshgrid(np.arange(0.05, 6, 0.1), np.arange(0.05, 4, 0.1))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def colours_at(picture, frame, place):
    """Return a colour of a picture that is twice as large as its frame, below a headline."""
    col, row = np.floor(2 * frame.to_image(np.array([place]))[0]).astype(int)
    return picture[row + len(picture) - 2 * frame.height_px, col, ::-1].astype(int)


def test_places_in_the_rock_are_red_those_in_the_free_space_blue_and_unseen_ones_yellow(frame):
    points, off = np.array([[10.0, 10, 0], [20, 10, 0], [30, 10, 0]]), np.array([0.2, -0.2, 0.0])
    picture = draw_deviation(points, off, np.array([[35.0, 10, 0]]), frame, FIGURES)
    red, blue, grey, yellow = (colours_at(picture, frame, (x, 10)) for x in (10, 20, 30, 35))
    assert red[0] - red[2] > 100
    assert blue[2] - blue[0] > 100
    assert np.ptp(grey) == 0
    assert yellow[:2].min() - yellow[2] > 100


def test_the_largest_deviation_of_a_place_is_drawn(frame):
    points = np.array([[10.0, 10, 0]] * 3)
    picture = draw_deviation(points, np.array([0.0, 0.08, -0.01]), NONE, frame, FIGURES)
    assert colours_at(picture, frame, (10, 10)) == pytest.approx(colours_of(np.array([0.08]))[0], abs=1)


def test_rays_that_are_longer_in_the_world_end_magenta_and_shorter_ones_black(frame):
    ends, figures = np.array([[10.0, 10, 0], [20, 10, 0], [30, 10, 0]]), {"through_share": 0.3, "short_share": 0.3}
    rays = ends, np.array([0.5, -0.5, 0.2]), FIGURES | figures
    picture = draw_deviation(ends, np.zeros(3), NONE, frame, FIGURES, rays)
    longer, shorter, near = (colours_at(picture, frame, (x, 10)) for x in (10, 20, 30))
    assert min(longer[0], longer[2]) - longer[1] > 150
    assert shorter.max() < 50
    assert np.ptp(near) == 0 < near[0]


def test_the_3d_view_has_the_facets_again_in_colours_of_the_points_beside_them(box):
    points = floor_points()
    off = np.where(points[:, 0] < 3, 0.1, -0.1)
    scene = trimesh.Scene()
    add_deviation(scene, *box, points, off)
    assert {name.rpartition("_")[0] for name in scene.geometry} == {"deviation", "roof_deviation"}
    red, blue = (scene.geometry[f"deviation_{k}"].triangles_center for k in (5, -5))
    assert red[:, 0].max() < 3.3 < 3.7 < blue[:, 0].max()
    assert red[:, 2].max() < 0.5  # walls that no point is near are yellow
    assert sum(mesh.area for mesh in scene.geometry.values()) == pytest.approx(2 * (24 + 18 + 12))


def test_what_no_point_is_near_is_yellow(box):
    scene = trimesh.Scene()
    add_deviation(scene, *box, floor_points(), np.zeros(2400))
    assert set(scene.geometry) == {"deviation_0", "deviation_6", "roof_deviation_6"}
    red, green, blue = scene.geometry["roof_deviation_6"].visual.material.baseColorFactor[:3]
    assert min(int(red), int(green)) > 3 * int(blue)


@pytest.mark.slow
def test_a_button_shows_the_deviation_in_place_of_the_rock(box, tmp_path):
    browser = find_browser()
    if browser is None:
        pytest.skip("no Chromium on this machine (Debian: chromium-headless-shell)")
    from playwright.sync_api import sync_playwright

    page_file = tmp_path / "page.html"
    way = np.column_stack([np.linspace(-2, 2, 5), np.zeros(5), np.full(5, -1.5)])
    page_file.write_text(walked_page(facet_scene(*box, (floor_points(), np.zeros(2400))), way))
    with sync_playwright() as run:
        arguments = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
        page = run.chromium.launch(executable_path=browser, args=arguments).new_page()
        page.set_default_timeout(60_000)
        page.goto(page_file.as_uri())
        page.locator("#deviation").wait_for()
        found = [set(page.evaluate(SHOWN))]
        for button in ("deviation", "deviation", "headlamp"):
            page.locator(f"#{button}").click()
            found.append(set(page.evaluate(SHOWN)))
    first, scanned, back, lamp = found
    assert "walls" in first
    assert not any("deviation" in name for name in first)
    assert scanned == {"deviation_0", "deviation_6"}
    assert back == first
    assert lamp == first | {"roof"}
