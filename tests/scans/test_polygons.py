"""Polygon faces that are not convex, as modelling programs write them, are cut into triangles that cover them."""

import struct

import ezdxf
import numpy as np
import pytest
import trimesh

from minesurveys.clouds.cloud_formats import read_blocks
from minesurveys.solids.files import read_triangles
from minesurveys.solids.polygons import triangles_of
from pipeline.errors import InputError
from pipeline.survey.solids.closing import close_pieces

# A T of drifts 4 m wide, its first corner where a fan folds over; 1,178 m3.
PLAN = np.array([(4, 0), (4, 40), (-24, 40), (-24, 44), (28, 44), (28, 40), (8, 40), (8, 0)], float)
HEIGHT_M, VOLUME_M3 = 3.2, 1177.6
SIDES = len(PLAN)
VERTICES = np.array([(*place, z) for z in (0, HEIGHT_M) for place in PLAN])


def prism(first):
    """The faces of the T: its floor and roof as one polygon each that begins at a corner, its walls as quads."""
    around = [(first + k) % SIDES for k in range(SIDES)]
    walls = [[k, (k + 1) % SIDES, SIDES + (k + 1) % SIDES, SIDES + k] for k in range(SIDES)]
    faces = [around[::-1], [SIDES + k for k in around], *walls]
    area = np.cross(PLAN, np.roll(PLAN, -1, axis=0)).sum() / 2
    return faces if area > 0 else [face[::-1] for face in faces]


def write_obj(path, vertices, faces, relative=False):
    start = -len(vertices) if relative else 1
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in vertices)
    rows = [" ".join(f"{k + start}//" if relative else str(k + start) for k in face) for face in faces]
    path.write_text("o mine\n" + text + "".join(f"f {row}\n" for row in rows))


def write_ply(path, vertices, faces, kind):
    head = (
        f"ply\nformat {kind} 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {len(faces)}\nproperty uchar red\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    if kind == "ascii":
        body = "".join(f"{x} {y} {z}\n" for x, y, z in vertices)
        body += "".join(f"200 {len(face)} {' '.join(map(str, face))}\n" for face in faces)
        path.write_text(head + body)
        return
    order = "<" if "little" in kind else ">"
    rows = [struct.pack(f"{order}BB{len(face)}i", 200, len(face), *face) for face in faces]
    path.write_bytes(head.encode() + vertices.astype(f"{order}f8").tobytes() + b"".join(rows))


def write(path, name, vertices, faces):
    match name:
        case "obj" | "relative.obj":
            write_obj(path, vertices, faces, name != "obj")
        case "dxf":
            drawing = ezdxf.new(units=6)
            mesh = drawing.modelspace().add_mesh()
            with mesh.edit_data() as data:
                data.vertices, data.faces = vertices.tolist(), faces
            drawing.saveas(path)
        case _:
            write_ply(path, vertices, faces, name)


def suffix_of(name):
    return name.rpartition(".")[2] if name.endswith(("obj", "dxf")) else "ply"


NAMES = ["obj", "relative.obj", "dxf", "ascii", "binary_little_endian", "binary_big_endian"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("first", range(SIDES))
def test_faces_that_are_not_convex_close_the_solid_whatever_corner_they_begin_with(tmp_path, name, first):
    path = tmp_path / f"a.{suffix_of(name)}"
    write(path, name, VERTICES, prism(first))
    read = read_triangles(path, path.read_bytes())
    found = close_pieces(read.vertices, read.faces, 1e-4, 0.5)
    assert sum(solid.volume() for solid in found.solids) == pytest.approx(VOLUME_M3)
    assert (found.holes, found.flipped) == ([], 0)


@pytest.mark.parametrize("name", NAMES)
def test_a_face_with_corners_on_a_straight_side_meets_its_neighbours(tmp_path, name):
    plan = np.array([(0, 0), (5, 0), (10, 0), (20, 0), (20, 4), (10, 4), (0, 4)], float)
    count = len(plan)
    vertices = np.array([(*place, z) for z in (0, 3) for place in plan])
    walls = [[k, (k + 1) % count, count + (k + 1) % count, count + k] for k in range(count)]
    path = tmp_path / f"a.{suffix_of(name)}"
    write(path, name, vertices, [list(range(count))[::-1], list(range(count, 2 * count)), *walls])
    read = read_triangles(path, path.read_bytes())
    found = close_pieces(read.vertices, read.faces, 1e-4, 0.5)
    assert sum(solid.volume() for solid in found.solids) == pytest.approx(20 * 4 * 3)
    assert found.holes == []


@pytest.mark.parametrize("name", ["obj", "ascii", "binary_little_endian"])
def test_points_on_a_mesh_that_is_read_as_a_scan_lie_in_its_faces(tmp_path, name):
    path = tmp_path / f"a.{suffix_of(name)}"
    write(path, name, VERTICES, prism(0))
    points = np.concatenate([block.points for block in read_blocks(path, 4.0)])
    in_stem = (points[:, 0] >= 4) & (points[:, 0] <= 8)
    in_bar = (points[:, 1] >= 40) & (points[:, 1] <= 44)
    assert len(points) > 1000
    assert (in_stem | in_bar).all()


def test_triangles_of_polygons_keep_order_sense_and_area():
    rng = np.random.default_rng(0)
    rings, sizes, areas = [], [], []
    for _ in range(200):
        size = int(rng.integers(3, 12))
        turn = np.sort(rng.uniform(0, 2 * np.pi, size))
        far = rng.uniform(0.2, 3, size)
        ring = np.column_stack([far * np.cos(turn), far * np.sin(turn), np.zeros(size)])
        wide = np.diff(np.append(turn, turn[0] + 2 * np.pi)).max() < np.pi  # else it may cross itself
        if not wide:
            continue
        rings.append(ring)
        sizes.append(size)
        areas.append(np.cross(ring, np.roll(ring, -1, axis=0))[:, 2].sum() / 2)
    vertices, sizes = np.concatenate(rings), np.array(sizes)
    faces = triangles_of(vertices, np.arange(len(vertices)), sizes)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    signed = np.cross(b - a, c - a)[:, 2] / 2
    owner = np.repeat(np.arange(len(sizes)), sizes - 2)
    assert (signed > 0).all()
    assert np.bincount(owner, signed) == pytest.approx(np.array(areas))


@pytest.mark.parametrize("cut", [3, 30, 200])
@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_a_ply_that_is_cut_off_is_refused_by_name(tmp_path, kind, cut):
    path = tmp_path / "a.ply"
    write_ply(path, VERTICES, prism(0), kind)
    path.write_bytes(path.read_bytes()[:-cut])
    with pytest.raises(InputError, match=r"a\.ply: not a mesh that a PLY file holds, or cut off"):
        read_triangles(path, path.read_bytes())


@pytest.mark.parametrize(
    "head",
    [
        "element face 999999999999\n",
        "element face 999999999999\nproperty list char int vertex_indices\n",
        "element vertex 999999999999\nproperty float x\nproperty float y\nproperty float z\n",
        "element face 1\nproperty list uint int vertex_indices\n",
    ],
)
@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_a_ply_of_hostile_counts_is_refused_at_once(tmp_path, kind, head):
    path = tmp_path / "a.ply"
    path.write_bytes(f"ply\nformat {kind} 1.0\n{head}end_header\n".encode() + b"-1 -1 -1\n" * 20)
    with pytest.raises(InputError, match=r"a\.ply: "):
        read_triangles(path, path.read_bytes())


def test_a_mesh_of_trimesh_keeps_its_vertices_and_triangles(tmp_path):
    mesh = trimesh.creation.icosphere(3, 5.0)
    for encoding in ("ascii", "binary"):
        mesh.export(tmp_path / "a.ply", encoding=encoding)
        read = read_triangles(tmp_path / "a.ply", (tmp_path / "a.ply").read_bytes())
        assert (read.faces == mesh.faces).all()
        assert read.vertices == pytest.approx(mesh.vertices, abs=1e-6)
