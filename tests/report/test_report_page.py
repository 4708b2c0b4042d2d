"""The report of a volume in Chromium, by what a person looks for, on a desktop and on a phone."""

import json
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.pictures.look_at_report import find_browser
from minesurveys.frames import Source
from tests.project import Project
from tests.volume_worlds import HEADER

pytestmark = pytest.mark.slow
# Walls, roof and floor of 1 to 3 are measured, those of 4 to 7 are not; 6 to 7 passes through 1 to 2, 0.2 m higher.
EAST, NORTH = 171400, 51100
MEASURED = {"1": (0, 0, 100), "2": (40, 0, 99), "3": (80, 0, 97)}
ASSUMED = {"4": (80, 40, 98), "5": (20, 40, 99.5), "6": (20, 10, 99.7), "7": (20, -30, 99.8)}
WIDTH_M = 3.0
THROUGH = "6 to 7 through 1 to 2"
SIZES = {"desktop": (1280, 900), "phone": (390, 844)}


def row(leg, station):
    x, y, z = (MEASURED | ASSUMED)[station]
    section = "1.7,1.3,2.5,0.3" if station in MEASURED else ",,,"
    return f"{leg},{station},{EAST + x},{NORTH + y},{z},{section}\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the folder of the world and what the command printed about it."""
    folder = tmp_path_factory.mktemp("page") / "mine"
    folder.mkdir()
    project = Project(folder, tiny=False)
    text = HEADER + "".join(row("A", station) for station in "123") + "".join(row("B", station) for station in "34567")
    (folder / "cross.csv").write_text(text)
    command = [sys.executable, "-m", "pipeline", "new", "cross", "--from", "cross.csv", "preset=light"]
    done = project.run(*command, check=False, COLUMNS="1000")
    assert done.returncode == 0, done.stderr
    return SimpleNamespace(world=folder / "artifacts/worlds/cross", printed=done.stderr)


@pytest.fixture(scope="module")
def browser():
    path = find_browser()
    if path is None:
        pytest.skip("no Chromium on this machine (Debian: chromium-headless-shell)")
    from playwright.sync_api import sync_playwright

    arguments = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
    with sync_playwright() as run:
        yield run.chromium.launch(executable_path=path, args=arguments)


@pytest.fixture(params=SIZES)
def page(request, made, browser):
    """Return the report, open at the size of a desktop or of a phone."""
    width, height = SIZES[request.param]
    opened = browser.new_page(viewport={"width": width, "height": height})
    opened.set_default_timeout(60_000)
    errors = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.goto((made.world / "report/report.html").as_uri())
    yield opened
    opened.close()
    assert errors == []


def on_screen(page, x, y):
    """Return where a place of the survey's own coordinates is in the window, by the numbers of the map's grid."""
    lines = page.evaluate(
        """() => [...document.querySelectorAll('#map .grid text')].map(t => {
             const l = t.previousElementSibling.getBoundingClientRect();
             return [l.height > l.width ? 0 : 1, Number(t.textContent.replaceAll(',', '')), l.x, l.y];
           })"""
    )
    place = []
    for axis, value in enumerate((x, y)):
        known = np.array([[number, at[axis]] for which, number, *at in lines if which == axis])
        slope, start = np.polyfit(known[:, 0] - value, known[:, 1], 1)
        assert abs(slope) > 0
        place.append(float(start))
    return place


def colour_at(page, place, aside=(0.0, 0.8)):
    """Return how the map says that a wall beside a station is known: the class of what is drawn there."""
    x, y = on_screen(page, EAST + place[0] + aside[0], NORTH + place[1] + aside[1])
    return page.evaluate("([x, y]) => document.elementFromPoint(x, y).getAttribute('class')", [x, y])


def test_the_headline_has_the_width_where_it_was_measured_and_the_share_of_the_stations(page):
    text = page.locator("#width").inner_text()
    assert re.search(rf"{WIDTH_M:.2f} m", text)
    assert "at 3 of 7 stations (43 %)" in text


def test_the_map_shows_which_walls_roofs_and_floors_were_measured(page):
    page.locator("#map svg").scroll_into_view_if_needed()
    for button in ("Walls", "Roof"):
        page.locator("#map button", has_text=button).click()
        assert colour_at(page, (30, 0, 0)) == "measured"
        assert colour_at(page, (50, 40, 0)) == "assumed"
    page.locator("#map button", has_text="Floor").click()
    assert colour_at(page, (50, 40, 0)) == "assumed"
    legend = page.locator("#map .legend").inner_text()
    assert all(word in legend for word in ("measured", "interpolated", "assumed"))


def test_a_station_is_found_by_its_name_with_its_place_and_what_is_known_there(page):
    page.locator("#map input").fill("6")
    page.locator("#map input").press("Enter")
    about = page.locator("#map .about").inner_text()
    x, y, z = ASSUMED["6"]
    assert f"E {EAST + x:,.1f}, N {NORTH + y:,.1f}, elevation {z:.1f} m" in about
    assert about.count("(assumed)") == 4
    chosen = page.locator("#map .name.chosen")
    assert chosen.text_content() == "6"
    found = chosen.bounding_box()
    at = on_screen(page, EAST + x, NORTH + y)
    assert np.hypot(found["x"] - at[0], found["y"] - at[1]) < 40


def test_names_of_stations_can_be_read_and_do_not_cover_each_other(page):
    for chart in ("map", "section"):
        boxes = [found.bounding_box() for found in page.locator(f"#{chart} .name").all()]
        assert len(boxes) == 7
        assert min(box["height"] for box in boxes) >= 11
        for k, one in enumerate(boxes):
            for other in boxes[k + 1 :]:
                apart_x = max(one["x"] - other["x"] - other["width"], other["x"] - one["x"] - one["width"])
                apart_y = max(one["y"] - other["y"] - other["height"], other["y"] - one["y"] - one["height"])
                assert max(apart_x, apart_y) > -4


def test_the_axes_of_the_map_have_the_coordinates_of_the_file(page):
    numbers = [int(text.replace(",", "")) for text in page.locator("#map .grid text").all_text_contents()]
    assert any(EAST - 100 < number < EAST + 200 for number in numbers)
    assert any(NORTH - 100 < number < NORTH + 200 for number in numbers)


def test_the_long_section_has_elevations_and_names(page):
    numbers = [float(text.replace(",", "")) for text in page.locator("#section .grid text").all_text_contents()]
    assert any(96 < number < 103 for number in numbers)
    assert sorted(page.locator("#section .name").all_text_contents()) == sorted(MEASURED | ASSUMED)


def test_every_remark_that_the_command_printed_is_on_the_page(made, page):
    shown = re.sub(r"\W", "", page.locator("table.remarks").inner_text())
    printed = made.printed[made.printed.index("guessed, dropped or assumed") :].splitlines()[2:]
    texts = [re.sub(r"\W", "", max(re.split(r" {2,}", line.strip()), key=len)) for line in printed]
    assert len(texts) >= 8
    assert [text for text in texts if text not in shown] == []


def test_floors_that_break_through_each_other_are_a_list_with_places_on_the_map(page):
    item = page.locator("li", has_text=THROUGH)
    assert item.count() == 1
    item.locator("a").click()
    assert THROUGH in page.locator("#map .about").inner_text()
    mark = page.locator("#map .place").bounding_box()
    at = on_screen(page, EAST + 20, NORTH)
    assert np.hypot(mark["x"] + mark["width"] / 2 - at[0], mark["y"] + mark["height"] / 2 - at[1]) < 15
    window = page.viewport_size
    assert 0 < mark["x"] < window["width"]
    assert 0 < mark["y"] < window["height"]


def test_a_leg_is_named_by_its_stations_which_the_map_shows(page):
    page.locator("#legs + details a", has_text="5").first.click()
    assert page.locator("#map .name.chosen").text_content() == "5"


def test_every_figure_and_clause_has_a_sentence_and_a_link_to_the_docs(page):
    for text in page.locator("table.figures tr td:first-child > span:first-child").all_inner_texts():
        assert " " in text, text
    for head in page.locator("h2#figures ~ h3").all():
        if head.evaluate("h => h.nextElementSibling.className") == "figures":
            assert "/docs/" in head.locator("a").get_attribute("href")


def test_parameters_of_the_default_mine_are_not_listed_as_those_of_this_one(page):
    text = page.locator("#provenance ~ details table").text_content()
    assert "survey.file" in text
    assert "labels_m" not in text


def test_nothing_scrolls_sideways(page):
    beyond = page.evaluate(
        """() => [...document.querySelectorAll('body *')].filter(e => !e.closest('svg, datalist, script, style'))
             .filter(e => e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== 'inline'
                          || e.getBoundingClientRect().right > innerWidth + 1)
             .map(e => e.tagName + '.' + e.className + ': ' + e.textContent.slice(0, 60))"""
    )
    assert beyond == []
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]


def test_the_3d_view_shows_what_is_measured_in_the_colours_of_the_map(page):
    page.locator("iframe.scene").scroll_into_view_if_needed()
    frame = page.frame_locator("iframe.scene")
    frame.locator("#known").wait_for()
    frame.locator("#known").click()
    assert frame.locator("#legend").is_visible()
    drawn = page.frames[-1].evaluate(
        """() => { const found = []; scene.traverse(o => { if (o.isMesh && /_k/.test(o.name)) found.push(
             [o.name, o.material.color.r > o.material.color.b]); }); return found; }"""
    )
    red = {name[-1] for name, is_red in drawn if is_red}
    assert {name[-1] for name, _ in drawn} == {str(int(Source.ASSUMED)), str(int(Source.MEASURED))}
    assert red == {str(int(Source.ASSUMED))}


def test_the_figures_of_the_world_state_its_list_whole(made):
    metrics = json.loads((made.world / "validation/metrics.json").read_text())
    assert [line for line in metrics["floor"]["through"] if line.startswith(THROUGH)]
