"""Forged worlds with heights: a floor's mesh that no builder writes is refused, however well it is sealed."""

from __future__ import annotations

import io
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from minexplore.bundle import FLOOR, RECORD, BundleError
from minexplore.floors.floor import Floor
from minexplore.schema import check_files, hash_files, read_folder
from minexplore.schema.readers.json_text import read_json
from pipeline.errors import ArtifactError
from pipeline.mjcf.bundle import read_record
from pipeline.proof.rebuilt.same_floor import require_floor
from pipeline.store.codecs import encode
from tests.heights import RAMP
from tests.mines import sealed

STEEPEST_DEG = 30.0


@pytest.fixture(scope="module")
def ramp(mine_of_legs):
    return mine_of_legs(RAMP, "preset=light")


def with_face(floor: Floor, corners: np.ndarray) -> Floor:
    """Return a floor with one more face of three corners (3, 3) m of its own."""
    number = len(floor.vertices) + np.arange(3, dtype=np.int32)
    sheet = np.append(floor.sheet, floor.sheet[:1])
    return replace(
        floor, vertices=np.vstack([floor.vertices, corners]), faces=np.vstack([floor.faces, number]), sheet=sheet
    )


def pinched(floor: Floor) -> Floor:
    """Return a floor without two faces that have one corner in common, and no other."""
    first = floor.faces[0]
    other = next(k for k, face in enumerate(floor.faces) if len(np.intersect1d(face, first)) == 1)
    return replace(floor, faces=np.delete(floor.faces, [0, other], axis=0), sheet=np.delete(floor.sheet, [0, other]))


def cut_open(floor: Floor, gap_m: float, step_m: float) -> Floor:
    """Return a floor in two pieces, as if cut across at 24 m: the eastern one has corners of its own and is higher."""
    east = floor.vertices[floor.faces, 0].mean(axis=1) > 24
    both = np.intersect1d(floor.faces[east], floor.faces[~east])
    number = np.arange(len(floor.vertices), dtype=np.int32)
    number[both] = len(floor.vertices) + np.arange(len(both))
    vertices = np.vstack([floor.vertices, floor.vertices[both] + [gap_m, 0, 0]])
    faces = floor.faces.copy()
    faces[east] = number[faces[east]]
    vertices[np.unique(faces[east]), 2] += step_m
    return replace(floor, vertices=vertices, faces=faces)


TINY = np.array([[0, 0, 0], [1e-160, 0, 0], [0, 1e-150, 0]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: replace(f, offset_m=np.array([[0.0, 0], [100, 0]])), "a sheet that is not there, or has no faces"),
        (lambda f: replace(f, offset_m=np.array([[0.0, 0], [1e308, 0]])), "an offset that is not finite, beyond"),
        (
            lambda f: replace(
                f, offset_m=np.array([[0.0, 0], [100, 0]]), sheet=np.arange(len(f.faces), dtype=np.int32) % 2
            ),
            "a sheet that is neither east of the one before it nor north of its row",
        ),
        (lambda f: with_face(f, TINY), "or has no area"),
        (
            lambda f: replace(f, faces=np.vstack([f.faces, f.faces[:1]]), sheet=np.append(f.sheet, f.sheet[:1])),
            "an edge with two faces on one side",
        ),
        (lambda f: replace(f, vertices=np.vstack([f.vertices, f.vertices[:1]])), "a corner without a face"),
        (pinched, "a corner at which the boundary meets itself"),
    ],
)
def test_a_floor_that_is_no_mesh_of_sheets_is_one_error(ramp, change, message):
    floor = change(ramp.floor)
    files = {**read_folder(ramp.bundle), FLOOR: encode(Path(FLOOR), floor)}
    heights = {**read_json(RECORD, files[RECORD])["heights"], "sheets": len(floor.offset_m)}
    files = sealed(files, heights=heights)
    with pytest.raises(BundleError, match=message):
        check_files(Path("bundle"), files, hash_files(files))


def test_the_steepest_face_is_computed_and_not_believed(ramp):
    files = read_folder(ramp.bundle)
    files = sealed(files, heights={**read_json(RECORD, files[RECORD])["heights"], "steepest_deg": 1.0})
    with pytest.raises(BundleError, match=r"heights\.steepest_deg = 1\.0: floor\.npz has \d+\.\d{3}"):
        check_files(Path("bundle"), files, hash_files(files))


@pytest.mark.parametrize("method", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
def test_a_floor_that_is_packed_by_another_method_is_refused_before_it_is_unpacked(ramp, method):
    files, packed = read_folder(ramp.bundle), io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(files[FLOOR])) as source, zipfile.ZipFile(packed, "w", method) as target:
        for name in source.namelist():
            target.writestr(name, source.read(name))
    files = sealed({**files, FLOOR: packed.getvalue()})
    with pytest.raises(BundleError, match=rf"floor\.npz: packed by method {method}, want 0 or 8"):
        check_files(Path("bundle"), files, hash_files(files))


def test_places_far_from_a_floor_of_many_faces_take_little_memory(ramp):
    copies = 100
    shift = np.repeat(np.arange(copies), len(ramp.floor.vertices))[:, None] * [0.0, 100.0, 0.0]
    faces = np.tile(ramp.floor.faces, (copies, 1)) + np.repeat(
        np.arange(copies, dtype=np.int32) * len(ramp.floor.vertices), len(ramp.floor.faces)
    )[:, None].astype(np.int32)
    floor = Floor(np.tile(ramp.floor.vertices, (copies, 1)) + shift, faces, np.zeros(len(faces), np.int32))
    places = np.random.default_rng(0).uniform(-1, 1, (4096, 2)) - 5000.0
    tracemalloc.start()
    floor.faces_at(places)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(faces) * len(places) * 16 > 5e8  # bytes, if all pairs were tried at once
    assert peak < 2e8


def refusal_of(floor: Floor, mine, folder: Path, steepest_deg: float = STEEPEST_DEG) -> str:
    """Return why a floor is not that of a mine's outline, "" if it is."""
    (folder / FLOOR).write_bytes(encode(Path(FLOOR), floor))
    try:
        require_floor(folder, read_record(mine.bundle), mine.free_space.polygon, steepest_deg)
    except ArtifactError as error:
        return str(error)
    return ""


def test_the_builders_floor_fits_its_outline(ramp, tmp_path):
    assert refusal_of(ramp.floor, ramp, tmp_path) == ""


@pytest.mark.parametrize("gap_m", [0.0, 1e-5, -1e-5])
def test_a_floor_that_is_cut_open_may_have_a_step_and_is_refused(ramp, tmp_path, gap_m):
    assert "outline of free_space.geojson" in refusal_of(cut_open(ramp.floor, gap_m, 0.3), ramp, tmp_path)


def test_faces_over_each_other_are_refused(ramp, tmp_path):
    twice = with_face(ramp.floor, ramp.floor.vertices[ramp.floor.faces[7]] + [0, 0, 0.3])
    assert "m2 more than the outline" in refusal_of(twice, ramp, tmp_path)


def test_a_ramp_that_is_steeper_than_the_builder_makes_is_refused(ramp, tmp_path):
    steep = replace(ramp.floor, vertices=ramp.floor.vertices * [1, 1, 6])
    assert "the limit is compile3d.steepest_deg = 30" in refusal_of(steep, ramp, tmp_path)
