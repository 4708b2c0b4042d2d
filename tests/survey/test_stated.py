"""Options of `new`: values out of range, options that nothing reads, and files that are none."""

import argparse
import os
from pathlib import Path
from typing import Annotated

import cv2
import ezdxf
import numpy as np
import pytest
import yaml
from pydantic import Field

import pipeline.commands.options as options_module
import pipeline.params.stated as stated_module
from minesurveys.formats import FileKind
from pipeline.commands.options import add_options, stated_options
from pipeline.errors import GeometryError, InputError, ParamsError
from pipeline.geometry.drawing.line_drawing import fill_line_drawing
from pipeline.own_mines import require_kept
from pipeline.params.stated import Option, StatedOptions, option, require_read, state
from pipeline.survey.detect import detect_survey
from pipeline.survey.scaled import require_extent
from tests.mines import TEE, frame_for, plan_of


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("px_per_m", 0.0, "--px-per-m = 0.0: want more than 0"),
        ("px_per_m", float("nan"), "--px-per-m = nan: want a finite number"),
        ("bar_length_m", -5.0, "--bar-length = -5.0"),
        ("wall_gap_px", -5.0, "--gap = -5.0: want at least 0"),
        ("wall_gap_px", 1e9, "--gap = 1000000000.0: want at most 200"),
        ("seeds_px", [[1e308, 0]], "--seed = 1e[+]308"),
        ("seeds_px", [[1, 1]] * 1001, "--seed = .*at most 1000 items"),
        ("elevations_m", {"a": 1e5}, "--elevation = 100000"),
        ("level", 10**30, "--level = 1000"),
        ("crop_px", [5, 5, 1, 1], "--crop = .*want west < east"),
        ("ignore_colours", [[300, 0, 0]], "--ignore = 300"),
        ("entrance_m", [1e308, 0], "--start = 1e[+]308"),
        ("bar_box_px", [-9, -9, -1, -1], r"--bar-box = \[-9, -9, -1, -1\]: not inside the picture of \d+ x \d+ px"),
    ],
)
def test_a_stated_value_out_of_range_is_refused_with_its_option(tmp_path, name, value, message):
    cv2.imwrite(str(tmp_path / "plan.png"), plan_of(TEE, frame_for(TEE)))
    with pytest.raises(InputError, match=rf"plan\.png: {message}"):
        detect_survey(tmp_path / "plan.png", state(tmp_path / "plan.png", {name: value}))


@pytest.mark.parametrize(
    ("file", "stated", "option"),
    [
        ("a.png", {"page": 2}, "--page"),
        ("a.png", {"layers": ["x"]}, "--layer"),
        ("a.tif", {"dpi": 100.0}, "--dpi"),
        ("a.dxf", {"px_per_m": 8.0}, "--px-per-m"),
        ("a.csv", {"unit": "mm"}, "--unit"),
        ("a.yaml", {"seeds_px": [[1, 1]]}, "--seed"),
        ("a.svx", {"crop_px": [0, 0, 5, 5]}, "--crop"),
    ],
)
def test_an_option_that_nothing_reads_with_a_kind_of_file_is_refused(tmp_path, file, stated, option):
    (tmp_path / file).write_bytes(b"x")
    with pytest.raises(InputError, match=rf"{file}: {option} is not read with an? .*; there are --"):
        detect_survey(tmp_path / file, state(tmp_path / file, stated))


def parse(*words):
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_options(parser)
    return stated_options(Path("a.png"), parser.parse_args(words))


def test_every_field_is_an_option_of_the_command_line_read_with_some_kind_of_file():
    typed = {  # flag -> its text, and its value
        "--px-per-m": ("8", 8.0),
        "--bar-length": ("20", 20.0),
        "--bar-box": ("1,2,3.5,4", (1.0, 2.0, 3.5, 4.0)),
        "--scale": ("1:2500", 2500.0),
        "--unit": ("mm", "mm"),
        "--half-width": ("2.5", 2.5),
        "--columns": ("leg=Code,easting_ft=E", {"leg": "Code", "easting_ft": "E"}),
        "--declination": ("-3.5", -3.5),
        "--heights": ("h.csv", Path("h.csv")),
        "--grade": ("A=0.1", {"A": 0.1}),
        "--piece": ("1,2,3", (1.0, 2.0, 3.0)),
        "--volume": ("", True),  # no value follows it
        "--start": ("1,2", (1.0, 2.0)),
        "--layer": ("a", ["a"]),
        "--elevation": ("a=b=5", {"a=b": 5.0}),
        "--level-by": ("floor", "floor"),
        "--no-elevation": ("-9999", -9999.0),
        "--snap": ("0", 0.0),
        "--close": ("0", 0.0),
        "--simplify": ("0.02", 0.02),
        "--up": ("y", "y"),
        "--voxel": ("0.1", 0.1),
        "--trajectory": ("way.txt", Path("way.txt")),
        "--page": ("2", 2),
        "--dpi": ("100", 100.0),
        "--crop": ("0,0,5,5", (0, 0, 5, 5)),
        "--level": ("1", 1),
        "--seed": ("5,6", [(5.0, 6.0)]),
        "--narrowest": ("0.4", 0.4),
        "--thinnest": ("0", 0.0),
        "--gap": ("4", 4.0),
        "--ignore": ("1,2,3", [(1, 2, 3)]),
    }
    declared = {name: option(name) for name in StatedOptions.model_fields}
    assert {option.flags[0] for option in declared.values()} == set(typed)
    for name, (flag, (text, value)) in zip(declared, typed.items(), strict=True):
        assert declared[name].flags[0] == flag
        assert getattr(parse(*filter(None, (flag, text))), name) == value
        assert declared[name].read_with
    assert parse() == StatedOptions()
    assert parse("--layer", "a", "--layer", "b").layers == ["a", "b"]


def test_a_new_field_is_an_option_without_further_declarations(monkeypatch):
    class WithMargin(StatedOptions):
        margin_m: Annotated[float | None, Option(("--margin",), (FileKind.PDF,))] = Field(None, ge=0, description="m")

    for module in (stated_module, options_module):
        monkeypatch.setattr(module, "StatedOptions", WithMargin)
    assert parse("--margin", "3").margin_m == 3.0
    with pytest.raises(InputError, match=r"a\.png: --margin = -3\.0: want at least 0"):
        parse("--margin", "-3")
    with pytest.raises(InputError, match=r"a\.png: --margin is not read with a picture; there are --bar-box"):
        require_read(Path("a.png"), FileKind.PICTURE, parse("--margin", "3"))


def test_a_kept_section_refuses_other_values_and_only_what_is_stated(tmp_path):
    conf = tmp_path / "mine.yaml"
    kept = {"seeds_px": [], "wall_gap_px": 3.0, "ignore_colours": [{"rgb": [1, 2, 3]}], "entrance_m": [5.0, 1.0]}
    conf.write_text(yaml.safe_dump({"survey": {**kept, "scale": {"px_per_m": 8.0}}}))
    require_kept(conf, StatedOptions())
    require_kept(conf, StatedOptions(px_per_m=8.0, ignore_colours=[(1, 2, 3)], entrance_m=(5.0, 1.0)))
    with pytest.raises(ParamsError, match=r"survey\.seeds_px = \[\[1\.0, 2\.0\]\]: .* states \[\]; change it there"):
        require_kept(conf, StatedOptions(seeds_px=[(1.0, 2.0)]))
    with pytest.raises(ParamsError, match=r"survey\.px_per_m = 9\.0: .* states 8\.0"):
        require_kept(conf, StatedOptions(px_per_m=9.0))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a" * 300 + ".png", "File name too long"),
        ("a\nb.png", "'.*\\\\nb.png': a path with line breaks"),
        ("\x1b[31m/a.png", "a path with line breaks, control characters"),
        ("\udcff.png", "or bytes that are no UTF-8"),
        ("folder.png", "not a plain file"),
        ("pipe.png", "not a plain file"),
    ],
)
def test_a_path_that_is_no_plain_file_is_refused_on_one_line(tmp_path, name, message):
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(InputError, match=message) as error:
        detect_survey(tmp_path / name)
    assert str(error.value).isprintable()


def test_walls_that_only_a_tiny_unit_would_close_are_refused_in_the_files_own_unit(tmp_path):
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = 6
    drawing.modelspace().add_lwpolyline([(0, 0), (60, 0), (60, 5), (0, 5)])  # in inches the gap is 13 cm
    drawing.saveas(tmp_path / "mine.dxf")
    with pytest.raises(InputError, match=r"the walls enclose nothing: the nearest ends left open are 5\.00 m apart"):
        detect_survey(tmp_path / "mine.dxf")


def test_lines_that_cover_the_whole_picture_enclose_nothing():
    for lines in ([[1, 0], [0, 1]], np.tile([[0, 1, 0]], (600, 1))):
        with pytest.raises(GeometryError, match="the drawn walls cover the whole picture"):
            fill_line_drawing(np.array(lines, bool), [], 9.0)


def test_a_plan_of_more_than_twenty_kilometres_is_refused():
    plan = np.zeros((600, 800, 3), np.uint8)
    require_extent("plan.png", plan, 0.04)
    for px_per_m in (0.03, 1e-300):
        with pytest.raises(InputError, match=r"plan\.png: the plan extends over .* the limit is 20,000 m"):
            require_extent("plan.png", plan, px_per_m)
