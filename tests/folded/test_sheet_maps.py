"""A Nav2 map of each sheet of a mine with heights: in its true place, and compared by the validator."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely

from minexplore.bundle import BundleError, sheet_map
from minexplore.schema import check_files, hash_files, read_folder
from pipeline.errors import ArtifactError
from pipeline.proof.validator import Validator
from pipeline.store.codecs import encode
from pipeline.survey.grid.nav2 import read_nav2_map
from tests.heights import RAMP, UNDER, certificate_params
from tests.mines import sealed


@pytest.fixture(scope="module")
def under(mine_of_legs):
    return mine_of_legs(UNDER, "preset=light")


def centres_of(nav2):
    """Return the centres of the free cells (n, 2) m."""
    row, col = np.nonzero(nav2.free)
    return np.array(nav2.origin_m) + (np.column_stack([col, row]) + 0.5) * nav2.cell_m


def test_the_free_cells_of_a_sheets_map_lie_where_the_sheet_does(under):
    floor, parts = under.floor, shapely.get_parts(under.free_space.polygon)
    assert len(floor.offset_m) == len(parts) == 2
    for sheet, (part, offset) in enumerate(zip(parts, floor.offset_m, strict=True)):
        nav2 = read_nav2_map(under.bundle / sheet_map(sheet)[0])
        places, true = centres_of(nav2), shapely.transform(part, lambda xy, d=offset: xy - d)
        assert shapely.contains_xy(true.buffer(0.01), *places.T).all()
        assert len(places) * nav2.cell_m**2 == pytest.approx(true.area, rel=0.03)
        assert not np.concatenate([nav2.free[[0, -1]].ravel(), nav2.free[:, [0, -1]].ravel()]).any()
    # The lower drift passes under the upper one: both are free at one place of the mine frame, and at two heights.
    upper, lower = (read_nav2_map(under.bundle / sheet_map(k)[0]) for k in range(2))
    for nav2 in (upper, lower):
        col, row = np.floor((np.array([30.0, 0.0]) - nav2.origin_m) / nav2.cell_m).astype(int)
        assert nav2.free[row, col]


def test_a_sheets_map_states_how_high_its_floor_is(under):
    for sheet, (low, high) in enumerate(under.floor.spans_m):
        first = (under.bundle / sheet_map(sheet)[0]).read_text().splitlines()[0]
        found = re.fullmatch(r"# sheet (\d) of 2: floor ([-\d.]+) to ([-\d.]+) m high", first)
        assert [float(value) for value in found.groups()] == pytest.approx([sheet, low, high], abs=6e-4)


def test_a_mine_of_one_sheet_has_no_maps_of_sheets(mine_of_legs):
    ramp = mine_of_legs(RAMP, "preset=light")
    assert not list(ramp.bundle.glob("map_*"))
    files = read_folder(ramp.bundle)
    files |= {"map_00.yaml": files["map.yaml"], "map_00.png": files["map.png"]}
    forged = sealed(files)
    with pytest.raises(BundleError, match=r"map_00\.(yaml|png): a map of a sheet; world\.json states 1 sheets"):
        check_files(ramp.bundle, forged, hash_files(forged))


def moved(files):
    text = files["map_01.yaml"].decode()
    west = float(re.search(r"origin: \[([-\d.]+)", text)[1])
    return {"map_01.yaml": text.replace(f"origin: [{west:.6f}", f"origin: [{west + 0.5:.6f}").encode()}


def repainted(files):
    pixels = cv2.imdecode(np.frombuffer(files["map_00.png"], np.uint8), cv2.IMREAD_UNCHANGED)
    far = cv2.distanceTransform(pixels, cv2.DIST_L2, 3)
    row, col = np.unravel_index(far.argmax(), far.shape)
    pixels[row - 2 : row + 3, col - 2 : col + 3] = 0
    return {"map_00.png": encode(Path("map_00.png"), pixels)}


def written(files, folder):
    for name, data in sealed(files).items():
        (folder / name).write_bytes(data)
    return folder


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (moved, r"map_01\.yaml: not the map of the clearance grid"),
        (repainted, r"map_00\.png: pixels differ from the clearance grid"),
    ],
)
def test_a_changed_map_of_a_sheet_is_found_by_the_validator(under, light, tmp_path, change, message):
    files = read_folder(under.bundle)
    folder = written({**files, **change(files)}, tmp_path)
    params = certificate_params(light, 10).model_copy(update={"extent": "full"})
    with pytest.raises(ArtifactError, match=message):
        Validator(params, folder, under.cleaned, under.raw, under.survey)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"map_01.yaml": None}, r"map_01\.yaml: missing"),
        ({"map_02.yaml": b"", "map_02.png": b""}, r"map_02\.(png|yaml): a map of a sheet; world\.json states 2 sheets"),
        ({"map_01.yaml": b"image: map_00.png\n"}, r"map_01\.yaml: want a remark on the sheet, image: map_01\.png"),
        ({"map_00.png": b"no picture"}, r"map_00\.png: "),
        ({"map_00.png": encode(Path("a.png"), np.zeros((9, 8), np.uint8))}, r"map_00\.png: 8 x 9 px, want \d+ x \d+"),
    ],
)
def test_maps_of_sheets_are_on_the_list_of_a_bundles_files(under, change, message):
    files = {name: data for name, data in {**read_folder(under.bundle), **change}.items() if data is not None}
    forged = sealed(files)
    with pytest.raises(BundleError, match=message):
        check_files(under.bundle, forged, hash_files(forged))
