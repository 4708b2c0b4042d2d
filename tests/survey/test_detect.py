"""Detection of a survey file's kind, scale, unit and style by `new`."""

import cv2
import ezdxf
import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from pipeline.errors import InputError
from pipeline.import_mine import survey_yaml
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import SurveyParams
from pipeline.survey.detect import detect_here, detect_survey
from pipeline.survey.draw import draw_plan, frame_around
from tests.mines import RING, TEE, frame_for, plan_of
from tests.project import TINY_STATIONS


def plan_with_bar(tmp_path, name="plan.png", invert=False, bar_m=20.0):
    plan, box = draw_plan(TEE, frame_around((-10, -20, 90, 60), 8.0), {}, bar_m, 40)
    cv2.imwrite(str(tmp_path / name), 255 - plan if invert else plan)
    return tmp_path / name, box


def test_a_scale_bar_is_found_and_its_length_chosen_by_the_width_of_the_drifts(tmp_path):
    path, _ = plan_with_bar(tmp_path)
    detected = detect_survey(path)
    assert detected.values["kind"] == "plan"
    assert detected.values["scale"]["source"] == "bar"
    assert detected.values["scale"]["bar_length_m"] == 20.0
    assert detected.width_m == pytest.approx(5.0, abs=0.4)
    assert detect_survey(path, StatedOptions(bar_length_m=50.0)).values["scale"]["bar_length_m"] == 50.0


def test_light_on_dark_is_detected_from_the_paper_at_the_edge(tmp_path):
    path, _ = plan_with_bar(tmp_path, invert=True)
    detected = detect_survey(path)
    assert detected.values["light_on_dark"]
    assert detected.values["scale"]["bar_length_m"] == 20.0


def test_line_drawings_are_distinguished_from_filled_drifts(tmp_path):
    frame = frame_for(RING)
    filled, line_drawing = plan_of(RING, frame), np.full((frame.height_px, frame.width_px, 3), 255, np.uint8)
    for ring in (RING.exterior, *RING.interiors):
        points = np.round(frame.to_image(np.array(ring.coords)) - 0.5).astype(np.int32)
        cv2.polylines(line_drawing, [points], True, (0, 0, 0), 2)
    for name, picture in (("filled.png", filled), ("line_drawing.png", line_drawing)):
        cv2.imwrite(str(tmp_path / name), picture)
        detected = detect_survey(tmp_path / name, StatedOptions(px_per_m=8.0))
        assert detected.values["line_drawing"] == (name == "line_drawing.png")
    assert not detect_survey(tmp_path / "filled.png", StatedOptions(px_per_m=8.0)).values["line_drawing"]


def test_a_plan_without_a_scale_is_refused_and_the_option_is_named(tmp_path):
    cv2.imwrite(str(tmp_path / "plan.png"), plan_of(TEE, frame_for(TEE)))
    with pytest.raises(InputError, match="no scale bar found; state --px-per-m"):
        detect_survey(tmp_path / "plan.png")


def test_a_drawing_without_units_gets_the_unit_that_makes_drift_widths_plausible(tmp_path):
    made = ezdxf.new()
    made.header["$INSUNITS"] = 0
    made.modelspace().add_lwpolyline(np.array(TEE.exterior.coords)[:-1] * 1000, close=True)
    made.saveas(tmp_path / "mine.dxf")
    detected = detect_survey(tmp_path / "mine.dxf")
    assert detected.values["unit"] == "mm"
    assert 3 < detected.width_m < 6


def test_detection_draws_no_plan_in_any_of_the_units_that_it_tries(tmp_path, monkeypatch):
    def refuse(*_):
        raise AssertionError("a plan was drawn")

    made = ezdxf.new(units=0)
    made.modelspace().add_lwpolyline(np.array(TEE.exterior.coords)[:-1] * 1000, close=True)
    made.saveas(tmp_path / "mine.dxf")
    monkeypatch.setattr("pipeline.survey.draw.draw_workings", refuse)
    assert detect_here(str(tmp_path / "mine.dxf"), {}).values["values"]["unit"] == "mm"


def test_a_wrong_unit_of_a_drawing_is_doubted_with_the_option_that_keeps_it(tmp_path, capsys):
    made = ezdxf.new(units=4)
    made.modelspace().add_lwpolyline(np.array(TEE.exterior.coords)[:-1], close=True)
    made.saveas(tmp_path / "house.dxf")
    assert detect_here(str(tmp_path / "house.dxf"), {}).values["values"]["unit"] == "m"
    told = capsys.readouterr().err
    assert "house.dxf: states the unit mm, and it gives no workings" in told
    assert "read as m, which makes them 4." in told
    assert "--unit mm keeps the stated unit" in told


def test_a_stated_unit_is_not_given_up_for_a_smaller_one_in_which_a_gap_closes(tmp_path):
    made = ezdxf.new(units=6)
    corners = 2 * np.array(TEE.exterior.coords)
    made.modelspace().add_lwpolyline([*corners[:-1], corners[0] + [0, 0.3]])
    made.saveas(tmp_path / "gap.dxf")
    with pytest.raises(InputError, match=r"ends left open are 0\.30 m apart.*--snap.*--unit ft reads drifts"):
        detect_survey(tmp_path / "gap.dxf")
    assert detect_survey(tmp_path / "gap.dxf", StatedOptions(unit="ft")).values["unit"] == "ft"


def test_every_detection_is_a_section_that_stage_one_accepts(tmp_path):
    path, _ = plan_with_bar(tmp_path)
    (tmp_path / "s.csv").write_text(TINY_STATIONS)
    for file in (path, tmp_path / "s.csv"):
        detected = detect_survey(file)
        text = survey_yaml("mine", tmp_path / file.name, detected, StatedOptions(entrance_m=(1.0, 2.0)))
        section = yaml.safe_load(text)["survey"]
        key = "image" if "image" in section else "file"
        assert section[key].endswith(file.name)
        read = TypeAdapter(SurveyParams).validate_python({**section, key: f"data/{file.name}"})
        assert read.entrance_m == (1.0, 2.0)


@pytest.mark.parametrize(
    ("name", "message"),
    [("none.png", "no such file"), ("a.qqq", "is not a supported format"), ("a", "without a suffix")],
)
def test_an_unsupported_file_is_refused(tmp_path, name, message):
    if name != "none.png":
        (tmp_path / name).write_bytes(b"x")
    with pytest.raises(InputError, match=message):
        detect_survey(tmp_path / name)


@pytest.mark.parametrize("given", [None, 0.0, 0.5])
def test_a_stated_gap_of_zero_is_zero_and_not_the_default(tmp_path, given):
    path, _ = plan_with_bar(tmp_path)
    kept = detect_survey(path, StatedOptions(wall_gap_px=given)).values["wall_gap_px"]
    assert kept == (3.0 if given is None else given)
    drawing = ezdxf.new(units=6)
    drawing.modelspace().add_lwpolyline(list(TEE.exterior.coords), close=True)
    drawing.saveas(tmp_path / "tee.dxf")
    kept = detect_survey(tmp_path / "tee.dxf", StatedOptions(snap_m=given)).values["snap_m"]
    assert kept == (0.25 if given is None else given)


def test_walls_with_a_gap_of_a_pixel_enclose_nothing_if_no_gap_is_closed(tmp_path):
    picture = np.full((200, 200, 3), 255, np.uint8)
    cv2.rectangle(picture, (40, 40), (160, 160), (0, 0, 0), 2)
    picture[30:50, 100] = 255
    cv2.imwrite(str(tmp_path / "walls.png"), picture)
    read = [
        detect_survey(tmp_path / "walls.png", StatedOptions(px_per_m=8.0, wall_gap_px=gap)).values["line_drawing"]
        for gap in (3.0, 0.0)
    ]
    assert read == [True, False]


@pytest.mark.parametrize(("unit", "found"), [(2, None), (4, "m")])
def test_a_unit_that_a_drawing_states_is_kept_for_a_wide_room_and_not_where_it_makes_no_drift(tmp_path, unit, found):
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = unit  # feet: a room of 60 x 30 m; millimetres: nothing that one can walk in
    sides = np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]]) * (60 / 0.3048 if unit == 2 else 20)
    drawing.modelspace().add_lwpolyline(sides.tolist(), close=True)
    drawing.saveas(tmp_path / "room.dxf")
    assert detect_survey(tmp_path / "room.dxf").values["unit"] == found


@pytest.mark.parametrize("name", ["a.csv", "a.dxf", "a.png", "a.svx", "a.yaml"])
def test_an_empty_file_is_called_empty(tmp_path, name):
    (tmp_path / name).touch()
    with pytest.raises(InputError, match=rf"{name}: empty file"):
        detect_survey(tmp_path / name)


def test_a_file_for_plotters_is_no_plot_file_of_compass(tmp_path):
    (tmp_path / "a.plt").write_text("IN;SP1;PU0,0;PD4000,0,4000,200;SP0;")
    with pytest.raises(InputError, match=r"a file for plotters \(HPGL\), none of Compass; save the drawing as \.dxf"):
        detect_survey(tmp_path / "a.plt")
