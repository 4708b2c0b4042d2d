"""Solids of workings: read from every mesh format, closed, and joined."""

import json
from types import SimpleNamespace

import manifold3d
import numpy as np
import pytest
import trimesh

from benchmarks.scans.solid_files import write, write_surpac
from minesurveys.solids.files import read_triangles
from pipeline.errors import InputError
from pipeline.survey.solids.closing import close_pieces
from pipeline.survey.solids.free_space import free_space_of

WELD_M, HOLE_M = 1e-4, 0.5


def crossing_tunnels():
    """A drift of 12 m and a crosscut of 8 m, joined: vertices, faces and volume."""
    drift = manifold3d.Manifold.cube([12, 3, 2.5])
    union = drift + manifold3d.Manifold.cube([3, 8, 2.5]).translate([4, -2, 0.5])
    mesh = union.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, np.int64), union.volume()


def closed(path, largest_hole_m=HOLE_M, layers=None):
    read = read_triangles(path, path.read_bytes(), layers)
    vertices = read.vertices[:, [0, 2, 1]] * [1, -1, 1] if read.up == "y" else read.vertices
    pieces = close_pieces(vertices, read.faces, WELD_M, largest_hole_m)
    return read, SimpleNamespace(**vars(pieces) | vars(free_space_of(pieces, WELD_M)))


@pytest.mark.parametrize(
    "name",
    [
        *("a.obj", "a.stl", "a.ply", "a.glb", "a.dtm", "a.xml", "a.dae", "a.omf"),
        *("MESH.dxf", "POLYFACE.dxf", "3DFACE.dxf"),
    ],
)
def test_a_solid_has_the_same_volume_and_place_from_every_format(tmp_path, name):
    vertices, faces, volume = crossing_tunnels()
    write(tmp_path / name, vertices, faces, name.partition(".")[0])
    read, found = closed(tmp_path / name)
    assert found.solid.volume() == pytest.approx(volume, abs=1e-4)
    assert found.solid.bounding_box() == pytest.approx((*vertices.min(axis=0), *vertices.max(axis=0)), abs=1e-5)
    assert (len(found.solids), found.holes, found.turned, found.flipped) == (1, [], 0, 0)
    assert read.unit == (None if name.endswith(("obj", "stl", "ply", "dtm")) else "m")


def test_points_of_a_triangulation_are_numbered_with_the_records_between_strings_where_their_numbers_need_it(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    write_surpac(tmp_path / "a.dtm", vertices, faces, parted=(2, 7))
    assert closed(tmp_path / "a.dtm")[1].solid.volume() == pytest.approx(volume, abs=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1, 2,", "1, 999,", r"a\.dtm: a triangle of point 999; a\.str has \d+"),
        ("OBJECT, 1,", "OBJECT, 1,\n1, 2, x, 4,", r"a\.dtm:4: '1, 2, x, 4,' is no triangle"),
        ("a.str", "a\0str", r"a\.dtm: a binary Surpac triangulation"),
    ],
)
def test_a_broken_triangulation_is_refused_by_what_is_wrong(tmp_path, old, new, message):
    vertices, faces, _ = crossing_tunnels()
    faces[0, 0] = 1
    write_surpac(tmp_path / "a.dtm", vertices, faces)
    (tmp_path / "a.dtm").write_text((tmp_path / "a.dtm").read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        closed(tmp_path / "a.dtm")


@pytest.mark.parametrize(
    ("needed", "accessor", "mode", "message"),
    [
        ("EXT_meshopt_compression", {}, 4, "EXT_meshopt_compression"),
        ("KHR_mesh_quantization", {"normalized": True}, 4, "shares of integers as corners"),
        ("KHR_mesh_quantization", {}, 4, None),
        ("KHR_texture_transform", {}, 4, None),
        ("KHR_texture_transform", {"sparse": {"count": 1}}, 4, "sparse corners"),
        ("KHR_texture_transform", {}, 6, "triangle fans"),
    ],
)
def test_a_glb_whose_corners_or_faces_would_be_others_is_refused(tmp_path, needed, accessor, mode, message):
    vertices, faces, volume = crossing_tunnels()
    data = trimesh.Trimesh(vertices, faces, process=False).export(file_type="glb")
    size = int.from_bytes(data[12:16], "little")
    stated = json.loads(data[20 : 20 + size]) | {"extensionsRequired": [needed]}
    stated["accessors"] = [one | accessor for one in stated["accessors"]]
    stated["meshes"][0]["primitives"][0]["mode"] = mode
    chunk = json.dumps(stated).encode()
    chunk += b" " * (-len(chunk) % 4)
    head = (len(data) - size + len(chunk)).to_bytes(4, "little") + len(chunk).to_bytes(4, "little")
    (tmp_path / "a.glb").write_bytes(data[:8] + head + data[16:20] + chunk + data[20 + size :])
    if message:
        with pytest.raises(
            InputError, match=rf"a\.glb: its meshes need {message}, which is not read; export it as plain triangles"
        ):
            closed(tmp_path / "a.glb")
    else:
        assert closed(tmp_path / "a.glb")[1].solid.volume() == pytest.approx(volume, abs=1e-4)


def test_a_triangulation_without_its_strings_is_refused(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    write_surpac(tmp_path / "a.dtm", vertices, faces)
    (tmp_path / "a.str").unlink()
    with pytest.raises(InputError, match=r"a\.dtm: a\.str is not beside it"):
        closed(tmp_path / "a.dtm")


def test_inverted_normals_are_turned_and_counted(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    write(tmp_path / "a.obj", vertices, faces[:, ::-1])
    found = closed(tmp_path / "a.obj")[1]
    assert (found.turned, found.solid.volume()) == (1, pytest.approx(volume))


def test_a_mesh_that_its_place_in_a_scene_mirrors_keeps_its_sense(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(extents=[6, 2, 2]), transform=np.diag([1.0, 1.0, -1.0, 1.0]))
    scene.export(tmp_path / "a.glb")
    assert closed(tmp_path / "a.glb")[1].turned == 0


def test_single_triangles_that_are_turned_over_are_turned_back(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    faces[[2, 9, 11]] = faces[[2, 9, 11]][:, ::-1]
    write(tmp_path / "a.obj", vertices, faces)
    found = closed(tmp_path / "a.obj")[1]
    assert (found.flipped, found.turned, found.solid.volume()) == (3, 0, pytest.approx(volume))


def test_a_hole_is_filled_up_to_the_stated_width_and_listed(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    end = np.flatnonzero((vertices[faces][:, :, 0] == 0).all(axis=1))
    write(tmp_path / "a.ply", vertices, np.delete(faces, end, axis=0))
    with pytest.raises(InputError, match=r"a hole 3.50 m wide at \(0.0, 1.5, 1.2\) m .* over 0.5 m; --close M"):
        closed(tmp_path / "a.ply")
    found = closed(tmp_path / "a.ply", 4.0)[1]
    assert found.solid.volume() == pytest.approx(volume)
    assert [round(hole.edge_m, 6) for hole in found.holes] == [11.0]


def test_solids_that_overlap_are_joined(tmp_path):
    one, two = (trimesh.creation.box(extents=[6, 2, 2]) for _ in range(2))
    two.apply_translation([4, 0.5, 0])
    trimesh.util.concatenate([one, two]).export(tmp_path / "a.stl")
    found = closed(tmp_path / "a.stl")[1]
    assert (len(found.solids), found.solid.volume()) == (2, pytest.approx(2 * 24 - 2 * 1.5 * 2))


def test_a_crumb_is_dropped_with_its_area(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    loose = np.array([[20.0, 0, 0], [21, 0, 0], [20, 1, 0]])
    write(
        tmp_path / "a.obj", np.concatenate([vertices, loose]), np.concatenate([faces, [len(vertices) + np.arange(3)]])
    )
    found = closed(tmp_path / "a.obj")[1]
    assert (found.dropped, found.dropped_m2, found.solid.volume()) == (1, pytest.approx(0.5), pytest.approx(volume))


def test_layers_are_chosen_by_name_and_an_unknown_one_lists_them(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    write(tmp_path / "a.dxf", vertices, faces)
    assert closed(tmp_path / "a.dxf", layers=["STOPE"])[1].solid.volume() == pytest.approx(volume)
    with pytest.raises(InputError, match="no layer DRIFT; there are STOPE"):
        closed(tmp_path / "a.dxf", layers=["DRIFT"])


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("b.obj", b"v 1 2\nv 3 4\nv 5 6\nf 1 2 3\n"),
        ("a.stl", b"solid x\nfacet"),
        ("a.obj", b"v 1 2\nf 1 2 3"),
        ("a.ply", b"ply\nformat"),
        ("a.glb", b"glTF\2\0\0\0"),
    ],
)
def test_a_broken_file_is_refused_by_its_name_in_one_line(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=name) as caught:
        closed(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [(b" 20\n0.0\n", b" 20\n1g+20\n"), (b"3DFACE", b"SOLID2")],
)
def test_a_broken_drawing_of_faces_is_refused_in_one_line(tmp_path, old, new):
    vertices, faces, _ = crossing_tunnels()
    write(tmp_path / "a.dxf", vertices, faces, "3DFACE")
    data = (tmp_path / "a.dxf").read_bytes()
    assert old in data
    (tmp_path / "a.dxf").write_bytes(data.replace(old, new))
    with pytest.raises(InputError, match=r"a\.dxf|no space|a hole"):
        closed(tmp_path / "a.dxf")


def test_a_triangle_of_a_corner_that_is_not_there_is_refused(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    write(tmp_path / "a.ply", vertices, faces)
    data = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "a.ply").write_bytes(data[:-4] + b"\xff\xff\x00\x00")
    with pytest.raises(InputError, match=r"a\.ply: a triangle of a corner|a\.ply: not a mesh"):
        closed(tmp_path / "a.ply")


def test_the_scanned_cave_closes(shared_rock):
    _, found = closed(shared_rock, 3.0)
    assert found.solid.volume() == pytest.approx(19.88, abs=0.01)
    assert (len(found.solids), len(found.holes), found.turned) == (3, 9, 3)


@pytest.mark.parametrize(
    ("suffix", "comment", "unit"),
    [
        (".obj", "# File units = inches\n", "in"),
        (".obj", "# a comment on units of production\n", None),
        (".ply", "comment unit: mm\n", "mm"),
        (".stl", "UNITS=mm", "mm"),
        (".stl", "units of nothing", None),
    ],
)
def test_a_unit_that_a_comment_states_is_used_and_listed(tmp_path, capsys, suffix, comment, unit):
    data = trimesh.creation.box((2, 2, 2)).export(file_type=suffix[1:])
    data = data.encode() if isinstance(data, str) else data
    head = data[: data.index(b"element vertex")] if suffix == ".ply" else b""
    text = comment.encode().ljust(80) if suffix == ".stl" else comment.encode()
    data = head + text + data[80 if suffix == ".stl" else len(head) :]
    assert read_triangles(tmp_path / f"a{suffix}", data).unit == unit
    assert ("a comment states the unit" in capsys.readouterr().err) == (unit is not None)
