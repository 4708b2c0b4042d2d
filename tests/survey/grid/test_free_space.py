import cv2
import numpy as np
import pytest
import shapely
import yaml

from minesurveys.errors import DoubtError
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import GridSurveyParams
from pipeline.survey.detect import detect_survey
from pipeline.survey.grid.plan import read_free_space, read_grid

CELL_M = 0.1
FREE, UNKNOWN, WALL = 254, 205, 0


def write_map(folder, grey, **options):
    """Write a map (rows, cols; row 0 in the north), and return its params; the south-west corner is at (0, 0)."""
    cv2.imwrite(str(folder / "map.pgm"), grey.astype(np.uint8))
    head = {"image": "map.pgm", "resolution": CELL_M, "origin": [0.0, 0.0, 0.0], "negate": 0}
    thresholds = {"occupied_thresh": 0.65, "free_thresh": 0.196}
    (folder / "map.yaml").write_text(yaml.safe_dump({**head, **thresholds, **options}))
    return params_of(folder)


def params_of(folder, **options):
    params = GridSurveyParams.model_validate({"kind": "grid", "name": "m", "map": "data/map.yaml", **options})
    return params.model_copy(update={"map": str(folder / "map.yaml")})


def box(grey, west, south, east, north, value):
    """Set the cells of a box, m."""
    rows = len(grey)
    grey[rows - round(north / CELL_M) : rows - round(south / CELL_M), round(west / CELL_M) : round(east / CELL_M)] = (
        value
    )
    return grey


def race_track(start):
    """Return thin walls of a track in paper that is free inside, on and outside of it, with the start on the track."""
    grey = np.full((300, 400), FREE, np.uint8)
    cv2.ellipse(grey, (200, 150), (150, 100), 0, 0, 360, WALL, 3)
    cv2.ellipse(grey, (200, 150), (120, 70), 0, 0, 360, WALL, 3)
    return {"grey": grey, "origin": [-start[0], -start[1], 0.0]}


def warehouse():
    grey = box(np.full((300, 300), UNKNOWN, np.uint8), 2, 2, 28, 28, WALL)
    box(grey, 2.2, 2.2, 27.8, 27.8, FREE)
    for k in range(5):
        box(grey, 4 + 5 * k, 5, 5.2 + 5 * k, 25, WALL)
    return {"grey": grey}


def museum():
    """Return rooms with doors of 0.9 m, most of it unknown."""
    grey = box(np.full((400, 400), UNKNOWN, np.uint8), 9.9, 9.9, 31.1, 18.1, WALL)
    for k in range(3):
        box(grey, 10 + 7 * k, 10, 16.9 + 7 * k, 18, FREE)
    box(grey, 16.9, 13, 24, 13.9, FREE)
    return {"grey": grey}


def barn():
    """Return a small field of scattered cylinders, open at its ends."""
    grey = np.full((60, 45), FREE, np.uint8)
    grey[:, [0, -1]] = WALL
    for col, row in ((10, 10), (30, 14), (20, 28), (8, 40), (34, 44)):
        cv2.circle(grey, (col, row), 2, WALL, -1)
    return {"grey": grey}


@pytest.mark.parametrize(
    ("layout", "area_m2", "obstacles"),
    [
        (warehouse(), 25.6**2 - 5 * 1.2 * 20, 5),
        (museum(), 3 * 6.9 * 8, 0),
        (barn(), 6 * 4.3 - 5 * 0.21, 5),
        ({"grey": np.full((80, 90), FREE, np.uint8)}, 72.0, 0),
        (race_track((3.0 + 3.5, 15.0)), None, 1),
    ],
    ids=["warehouse", "museum", "barn", "all free", "race track"],
)
def test_the_free_space_of_maps_of_any_layout_is_read(tmp_path, layout, area_m2, obstacles):
    params = write_map(tmp_path, **layout)
    workings = read_grid(params).workings
    assert len(workings.geoms) == 1
    assert len(workings.geoms[0].interiors) == obstacles
    if area_m2 is not None:
        assert workings.area == pytest.approx(area_m2, rel=0.03)


def test_of_several_areas_that_could_be_meant_the_one_at_the_maps_origin_is_built(tmp_path, capsys):
    layout = race_track((6.5, 15.0))
    outside, infield = (1.0, 1.0), (20.0, 15.0)
    workings = read_grid(write_map(tmp_path, **layout)).workings
    assert workings.contains(shapely.Point(0.0, 0.0))
    assert not workings.intersects(shapely.multipoints(np.array([outside, infield]) - (6.5, 15.0)))
    lines = capsys.readouterr().err.splitlines()
    assert "of 3 free areas that at the map's origin is built" in lines[0]
    assert "2 other free areas" in lines[1]
    assert max(map(len, lines)) <= 120


def test_several_areas_that_could_be_meant_are_asked_about_with_their_sizes_and_places(tmp_path):
    layout = race_track((6.5, 15.0)) | {"origin": [500.0, 500.0, 0.0]}
    write_map(tmp_path, **layout)
    with pytest.raises(
        DoubtError, match=r"3 free areas could be .* m2 at \(\d+\.\d, \d+\.\d\).*; --start E,N"
    ) as asked:
        read_free_space(params_of(tmp_path))
    assert asked.value.picture.shape == (300, 400, 3)
    for place in ((506.5, 515.0), (520.0, 515.0), (501.0, 501.0)):
        workings = read_grid(params_of(tmp_path, entrance_m=place)).workings
        assert workings.contains(shapely.Point(place))


def test_a_start_chooses_its_area_also_on_a_turned_map_far_from_its_origin(tmp_path):
    grey = box(np.full((200, 300), WALL, np.uint8), 1, 1, 14, 5, FREE)
    box(grey, 20, 10, 24, 14, FREE)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    params = write_map(tmp_path, grey, origin=[500_003.0, 4_000_007.0, np.pi / 2])
    assert read_grid(params).workings.area == pytest.approx(52, rel=0.01)
    start = turn @ (22.0, 12.0) + (3.0, 7.0)
    reading = read_grid(params.model_copy(update={"entrance_m": (*start, 1.0)}))
    assert reading.georeference.origin == (500_000.0, 4_000_000.0)
    corners = np.array([(20, 10), (24, 10), (24, 14), (20, 14)]) @ turn.T + (3.0, 7.0)
    assert reading.workings.symmetric_difference(shapely.Polygon(corners)).area < 0.2
    with pytest.raises(InputError, match=r"--start 500,500: no free area within 5 m; the largest has 52 m2 at"):
        read_grid(params.model_copy(update={"entrance_m": (500.0, 500.0)}))


def hall_with_rays():
    """Return a hall of 8 x 6 m, with a side drift 1 m wide, that a scanner saw out of through windows."""
    grey = box(np.full((300, 300), UNKNOWN, np.uint8), 12, 12, 20, 18, FREE)
    box(grey, 15, 18, 16, 22, FREE)
    for k in range(40):  # rays connect to the hall where they are side by side
        angle = 0.6 * np.pi + k * np.pi / 50
        end = (round(160 + 140 * np.cos(angle)), round(150 + 140 * np.sin(angle)))
        cv2.line(grey, (160, 150), end, FREE, 1)
    return grey


def test_rays_through_windows_are_left_out_and_the_hall_is_kept(tmp_path, capsys):
    params = write_map(tmp_path, hall_with_rays())
    workings = read_grid(params).workings
    truth = shapely.union(shapely.box(12, 12, 20, 18), shapely.box(15, 18, 16, 22))
    assert workings.symmetric_difference(truth).area < 3
    assert shapely.difference(truth, workings).area < 0.3
    assert "in corners and places narrower than 0.6 m are left out; --narrowest M" in capsys.readouterr().err
    with_rays = read_grid(params.model_copy(update={"narrowest_m": 0.0})).workings
    assert abs(with_rays.area - workings.area) > 0.5
    assert detect_survey(tmp_path / "map.yaml", StatedOptions(narrowest_m=0.3)).values["narrowest_m"] == 0.3


def test_free_cells_in_many_small_parts_are_refused(tmp_path):
    parts = np.where(np.random.default_rng(1).random((100, 100)) < 0.25, FREE, UNKNOWN)
    with pytest.raises(
        InputError, match=r"no connected floor: the largest of \d+ free areas that are wide enough has 0\.\d m2"
    ):
        read_free_space(write_map(tmp_path, parts))


def test_a_map_without_free_cells_is_refused_by_its_keys(tmp_path):
    with pytest.raises(InputError, match="no free cells; free_thresh and negate in the file"):
        read_free_space(write_map(tmp_path, np.full((50, 50), UNKNOWN, np.uint8)))


def test_specks_of_a_scan_are_left_out_and_counted(tmp_path, capsys):
    grey = warehouse()["grey"]
    grey[150:280:10, 30] = WALL  # 13 cells in the aisle along the western wall
    params = write_map(tmp_path, grey)
    assert len(read_grid(params).workings.geoms[0].interiors) == 5
    assert "map.yaml: 13 specks below 0.15 m are left out; --thinnest M" in capsys.readouterr().err
    assert len(read_grid(params.model_copy(update={"thinnest_m": 0.0})).workings.geoms[0].interiors) == 18
    found = detect_survey(tmp_path / "map.yaml", StatedOptions())
    assert found.values == {"kind": "grid", "map": "map.yaml", "narrowest_m": 0.6, "thinnest_m": 0.3}
    assert found.files == [tmp_path / "map.yaml", tmp_path / "map.pgm"]


def test_walls_of_one_cell_become_as_thick_as_rock_must_be_and_keep_their_doors(tmp_path, capsys):
    grey = np.full((200, 300), UNKNOWN, np.uint8)
    grey[20:180, 20:280] = FREE
    grey[20:180, 150] = WALL
    grey[90:110, 150] = FREE  # a door of 1 m
    params = write_map(tmp_path, grey, resolution=0.05)
    workings = read_grid(params).workings
    for y in (2.0, 3.0, 7.0, 8.0):
        across = workings.intersection(shapely.LineString([(2, y), (13, y)]))
        left, right = sorted(part.bounds for part in shapely.get_parts(across))
        assert 0.24 <= right[0] - left[2] <= 0.4
        assert (right[0] + left[2]) / 2 == pytest.approx(7.525, abs=0.06)
    door = shapely.LineString([(7.525, 3), (7.525, 7)]).intersection(workings)
    assert 0.7 <= door.length <= 1.0
    assert "walls thinner than 0.3 m are made so thick, which takes 1." in capsys.readouterr().err
    as_is = read_grid(params.model_copy(update={"thinnest_m": 0.0})).workings
    assert as_is.area == pytest.approx(8 * 13 - 7 * 0.05, rel=0.005)
