"""Block references of DXF drawings: scales of 0, clips, external references, and dimensions, which are no walls."""

import ezdxf
import numpy as np
import pytest
import shapely
from ezdxf.xclip import XClip

from minesurveys.reading import read_shapes
from minesurveys.vector.dxf import read_dxf
from pipeline.errors import InputError

RELEASE_9 = """  0
SECTION
  2
HEADER
  9
$ACADVER
  1
AC1004
  0
ENDSEC
  0
SECTION
  2
ENTITIES
{}  0
ENDSEC
  0
EOF
"""


def with_block(tmp_path, scale_code=None):
    """Write a drawing with a block of a polyline and a circle; a group code names the scale that is 0."""
    drawing = ezdxf.new(units=6)
    block = drawing.blocks.new("stope")
    block.add_lwpolyline([(0, 0), (50, 0), (50, 5), (0, 5)], close=True)
    block.add_circle((25, 20), 4)
    insert = drawing.modelspace().add_blockref("stope", (100, 200))
    if scale_code:
        insert.dxf.set({41: "xscale", 43: "zscale"}[scale_code], 3.25)
    drawing.saveas(tmp_path / "a.dxf")
    text = (tmp_path / "a.dxf").read_text()
    (tmp_path / "a.dxf").write_text(text.replace(f"{scale_code}\n3.25\n", f"{scale_code}\n0.0\n"))
    return tmp_path / "a.dxf"


@pytest.mark.parametrize("scale_code", [41, 43])
def test_a_block_reference_with_a_scale_of_0_is_read_with_the_scale_1(tmp_path, capsys, scale_code):
    wanted = read_dxf(with_block(tmp_path), None).shapes
    path = with_block(tmp_path, scale_code)
    found = read_dxf(path, None).shapes
    assert shapely.equals_exact(found, wanted, 1e-9).all()
    assert "1 block references have a scale of 0, read as 1; the first is stope at (100.0, 200.0)" in (
        capsys.readouterr().err
    )
    assert read_dxf(path, None, with_heights=True).shapes == found


def test_a_clip_of_a_block_reference_is_warned_of_as_the_block_is_read_whole(tmp_path, capsys):
    drawing = ezdxf.readfile(with_block(tmp_path))
    XClip(drawing.modelspace()[0]).set_block_clipping_path([(0, 0), (10, 10)])
    drawing.saveas(tmp_path / "a.dxf")
    assert len(read_dxf(tmp_path / "a.dxf", None).shapes) == 2
    assert "1 block references are clipped, and are read whole; the first is stope" in capsys.readouterr().err


def test_an_external_reference_is_named_as_its_drawing_is_not_in_the_file(tmp_path, capsys):
    drawing = ezdxf.readfile(with_block(tmp_path))
    drawing.add_xref_def("levels/850.dxf", "level-850")
    drawing.modelspace().add_blockref("level-850", (0, 0))
    drawing.saveas(tmp_path / "a.dxf")
    assert len(read_dxf(tmp_path / "a.dxf", None).shapes) == 2
    assert "1 drawings that it refers to are not in the file, and are not read: level-850; bind" in (
        capsys.readouterr().err
    )


def test_a_drawing_of_nothing_but_external_references_is_refused_with_their_names_and_the_way_on(tmp_path):
    drawing = ezdxf.new()
    drawing.add_xref_def("levels/850.dxf", "level-850")
    drawing.modelspace().add_blockref("level-850", (0, 0))
    drawing.saveas(tmp_path / "a.dxf")
    with pytest.raises(InputError, match=r"a\.dxf: holds .* no lines, only 1 external reference level-850; .* bind"):
        read_shapes(tmp_path / "a.dxf", None)


@pytest.mark.parametrize("hide", ["off", "freeze"])
def test_lines_on_a_layer_that_is_off_or_frozen_are_left_out_with_a_remark_unless_it_is_named(tmp_path, capsys, hide):
    drawing = ezdxf.new(units=6)
    drawing.layers.add("walls")
    getattr(drawing.layers.add("old survey"), hide)()
    for layer, west in (("walls", 0), ("Old Survey", 100), ("old survey", 200)):
        drawing.modelspace().add_lwpolyline(
            [(west, 0), (west + 50, 0), (west + 50, 5)], close=True, dxfattribs={"layer": layer}
        )
    drawing.saveas(tmp_path / "a.dxf")
    assert [shape.bounds[0] for shape in read_dxf(tmp_path / "a.dxf", None).shapes] == [0.0]
    assert "2 entities on layers that are off or frozen are not read" in capsys.readouterr().err
    assert len(read_dxf(tmp_path / "a.dxf", ["old survey"]).shapes) == 1
    getattr(drawing.layers.get("walls"), hide)()
    drawing.saveas(tmp_path / "a.dxf")
    assert len(read_dxf(tmp_path / "a.dxf", None).shapes) == 3


def test_the_lines_of_dimensions_and_leaders_are_no_walls(tmp_path):
    drawing = ezdxf.new(units=6, setup=True)
    drawing.modelspace().add_lwpolyline([(0, 0), (50, 0), (50, 5), (0, 5)], close=True)
    drawing.modelspace().add_linear_dim(base=(0, 9), p1=(0, 5), p2=(50, 5)).render()
    drawing.modelspace().add_leader([(10, 10), (20, 2)])
    drawing.saveas(tmp_path / "a.dxf")
    read = read_dxf(tmp_path / "a.dxf", None)
    assert [shape.length for shape in read.shapes] == [pytest.approx(110)]
    assert read.others == {"DIMENSION": 1, "LEADER": 1}


def test_a_drawing_of_release_9_is_read_and_a_damaged_one_is_refused_in_plain_words_with_its_release(tmp_path):
    line = "  0\nLINE\n  8\nribs\n 10\n0.0\n 20\n0.0\n 11\n{}\n 21\n7.0\n"
    path = tmp_path / "old.dxf"
    path.write_text(RELEASE_9.format(line.format("9.0")))
    read = read_dxf(path, None)
    assert np.array(read.shapes[0].coords).tolist() == [[0, 0], [9, 7]]
    assert read.layer_of == ["ribs"]
    path.write_text(RELEASE_9.format(line.format("nine")))
    with pytest.raises(
        InputError, match=r"old\.dxf: not a readable DXF drawing, of release 9: .*save it as DXF"
    ) as told:
        read_dxf(path, None)
    assert "Error" not in str(told.value)
