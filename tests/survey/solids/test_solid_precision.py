"""Meshes whose format holds numbers of 32 bits, at the coordinates of a map."""

import numpy as np
import pytest
import trimesh

from minesurveys.solids.files import read_triangles
from pipeline.errors import InputError
from pipeline.params.survey import SolidSurveyParams
from pipeline.survey.solids.read import read_solid

GRID = np.array([456_780.0, 5_712_340.0, -410.0])
PARAMS = SolidSurveyParams.model_validate({"kind": "solid", "name": "a", "file": "data/x"})


def drift(at):
    """A drift of 60 m, 4.1 x 3.2 m."""
    box = trimesh.creation.box((60, 4.1, 3.2))
    return trimesh.Trimesh(box.vertices + at, box.faces, process=False)


def read(path, **values):
    return read_solid(PARAMS.model_copy(update={"file": path.as_posix(), **values}), is_stated=False)


def write(path, at=GRID):
    mesh = drift(at)
    if path.suffix == ".ply":
        mesh.export(path, encoding="binary")  # trimesh writes floats of 32 bits
    else:
        mesh.export(path)
    return path


@pytest.mark.parametrize("name", ["a.stl", "a.ply"])
def test_a_mesh_of_32_bits_in_map_coordinates_is_refused_and_read_with_a_local_origin(tmp_path, name):
    path = write(tmp_path / name)
    with pytest.raises(
        InputError,
        match=rf"{name}: its y coordinates come in steps of 0\.5 m, so far .*; at most 0\.01 m is read",
    ):
        read(path)
    local = read(write(path, np.zeros(3)))  # as the refusal says
    assert np.ptp(local.solid.vertices, axis=0) == pytest.approx([60, 4.1, 3.2], abs=1e-4)


def test_the_steps_are_those_of_the_unit_that_is_read(tmp_path):
    path = tmp_path / "a.stl"
    mesh = drift(np.zeros(3))
    trimesh.Trimesh(mesh.vertices * 1000 + [500_000, 0, 0], mesh.faces, process=False).export(path)
    found = read(path, unit="mm")
    assert np.ptp(found.solid.vertices, axis=0) == pytest.approx([60, 4.1, 3.2], abs=1e-4)


@pytest.mark.parametrize("name", ["a.obj", "a.dxf", "text.stl", "text.ply", "float.ply"])
def test_a_mesh_as_text_is_as_fine_as_it_is_written(tmp_path, capsys, name):
    path, mesh = tmp_path / name, drift(GRID)
    match name:
        case "text.stl":
            path.write_text(trimesh.exchange.stl.export_stl_ascii(mesh))
        case "text.ply" | "float.ply":
            rows = [f"{x} {y} {z}" for x, y, z in mesh.vertices] + [f"3 {a} {b} {c}" for a, b, c in mesh.faces]
            head = "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty double z\n"
            head += "element face 12\nproperty list uchar int vertex_index\nend_header\n"
            path.write_text(
                head.replace("double", "float" if name == "float.ply" else "double") + "\n".join(rows) + "\n"
            )
        case "a.obj":
            path.write_text(trimesh.exchange.obj.export_obj(mesh, digits=6))
        case _:
            import ezdxf

            drawing = ezdxf.new(units=6)
            for triangle in mesh.triangles:
                drawing.modelspace().add_3dface(triangle.tolist())
            drawing.saveas(path)
    found = read(path)
    assert np.ptp(found.solid.vertices, axis=0) == pytest.approx([60, 4.1, 3.2], abs=1e-4)
    assert "steps" not in capsys.readouterr().err


def test_a_text_that_a_program_of_32_bits_wrote_is_named_with_its_steps(tmp_path, capsys):
    ball = trimesh.creation.icosphere(3, 10.0)
    rounded = (ball.vertices + GRID).astype(np.float32).astype(float)
    (tmp_path / "a.obj").write_text(
        trimesh.exchange.obj.export_obj(trimesh.Trimesh(rounded, ball.faces, process=False), digits=6)
    )
    read(tmp_path / "a.obj")
    assert "a.obj: its y coordinates come in steps of 0.5 m" in capsys.readouterr().err


def test_the_place_of_a_mesh_in_a_glb_scene_makes_it_no_coarser(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(drift(np.zeros(3)), transform=trimesh.transformations.translation_matrix(GRID[[0, 2, 1]]))
    scene.export(tmp_path / "a.glb")
    read_back = read_triangles(tmp_path / "a.glb", (tmp_path / "a.glb").read_bytes())
    assert np.ptp(read_back.vertices, axis=0) == pytest.approx([60, 4.1, 3.2], abs=1e-4)
    assert read_back.steps.max() < 1e-5
    assert (read_back.unit, read_back.up) == ("m", "y")


def test_a_corner_of_no_triangle_is_no_part_of_the_workings(tmp_path):
    text = trimesh.exchange.obj.export_obj(drift(GRID), digits=6)
    (tmp_path / "a.obj").write_text(text.rstrip() + "\nv 0 0 0\n")
    found = read(tmp_path / "a.obj")
    assert found.georeference.origin == (456_750.0, 5_712_330.0)


def test_a_solid_far_from_all_others_is_named_and_not_taken_for_a_unit(tmp_path):
    pebble = trimesh.creation.box((1, 1, 1))
    both = trimesh.util.concatenate([drift(GRID), *(drift(GRID + np.array([0, 9 * k, 0])) for k in (1, 2)), pebble])
    (tmp_path / "a.obj").write_text(trimesh.exchange.obj.export_obj(both, digits=6))
    with pytest.raises(
        InputError,
        match=r"a\.obj: 8 of 32 corners lie more than 10000 from the others, the first at \(.0\.5, .0\.5, .0\.5\), the "
        r"others about \(4567\d\d, 57123\d\d, -4\d\d\); delete what they belong to",
    ):
        read(tmp_path / "a.obj")
