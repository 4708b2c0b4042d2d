"""Solids as LandXML, Collada, USD and OMF: each states its unit and axes, which are used."""

import numpy as np
import pytest
import trimesh

from benchmarks.scans.solid_files import write_collada, write_landxml, write_omf, write_usd
from minesurveys.remarks import collect_remarks
from minesurveys.solids.files import read_triangles
from pipeline.errors import InputError
from pipeline.params.stated import StatedOptions
from pipeline.survey.detect import detect_survey
from tests.survey.solids.test_solid_files import crossing_tunnels

GRID = np.array([351234.25, 6301118.25, 400.0])
# A T, whose first corner does not see the whole: 3 m2.
TEE = np.array([[0, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0], [2, 3, 0], [1, 3, 0], [1, 1, 0], [0, 1, 0]], float)


def read(path):
    with collect_remarks() as remarks:
        found = read_triangles(path, path.read_bytes())
    return found, " ".join(remark.line() for remark in remarks)


def written(write, path, *content, **more):
    write(path, *content, **more)
    return path


def metres_of(found):
    """Return vertices in metres with z up."""
    scale = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}[found.unit]
    turned = found.vertices[:, [0, 2, 1]] * [1, -1, 1] if found.up == "y" else found.vertices
    return turned * scale


@pytest.mark.parametrize(
    ("units", "metres", "up_metres"),
    [
        ('<Metric linearUnit="meter" elevationUnit="meter"/>', 1, 1),
        ('<Metric linearUnit="millimeter" elevationUnit="meter"/>', 0.001, 1),
        ('<Imperial linearUnit="foot" elevationUnit="feet"/>', 0.3048, 0.3048),
        ('<Imperial linearUnit="USSurveyFoot" elevationUnit="feet"/>', 1200 / 3937, 1200 / 3937),
        ('<Imperial linearUnit="inch"/>', 0.0254, 0.0254),
    ],
)
def test_landxml_is_northing_first_in_the_units_that_it_states_for_lengths_and_elevations(
    tmp_path, units, metres, up_metres
):
    vertices, faces, volume = crossing_tunnels()
    stated = (vertices + GRID) / [metres, metres, up_metres]
    found, _ = read(written(write_landxml, tmp_path / "a.xml", stated, faces, units))
    np.testing.assert_allclose(metres_of(found), vertices + GRID, atol=1e-6)
    assert trimesh.Trimesh(metres_of(found) - GRID, found.faces).volume == pytest.approx(volume)
    assert found.layers == ("drift",)


def test_faces_of_landxml_that_are_marked_invisible_are_left_out_and_counted(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    found, remarks = read(
        written(write_landxml, tmp_path / "a.xml", vertices, faces, marks='<F i="1">7 8 9</F><F i="0">7 8 9</F>')
    )
    assert len(found.faces) == len(faces) + 1
    assert "1 faces are marked invisible and are left out" in remarks


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<LandXML", "<!DOCTYPE a><LandXML", r"has a document type"),
        ("LandXML", "Other", r"an XML file of 'Other'; of XML LandXML alone is read"),
        ('linearUnit="meter"', 'linearUnit="rod"', r"linearUnit='rod'; want millimeter"),
        ('<P id="8">', '<P id="7">', r"two points have one id"),
        ("</LandXML>", "", r"not well-formed XML"),
        ("<Faces>", "<Faces><F>1 2 3</F>", r"a face of point '1'"),
    ],
)
def test_a_broken_landxml_file_is_refused_by_what_is_wrong(tmp_path, old, new, message):
    vertices, faces, _ = crossing_tunnels()
    path = written(write_landxml, tmp_path / "a.xml", vertices, faces)
    path.write_text(path.read_text().replace(old, new) if old == "LandXML" else path.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        read(path)


def test_a_landxml_surface_of_a_floor_is_refused_with_what_reads_its_points(tmp_path):
    floor = np.array([[0, 0, 0], [10, 0, 1], [10, 4, 1], [0, 4, 0]], float)
    with pytest.raises(InputError, match=r"are those of a floor or a terrain, .* --heights reads it with a plan"):
        read(written(write_landxml, tmp_path / "a.xml", floor, np.array([[0, 1, 2], [0, 2, 3]])))


@pytest.mark.parametrize(("up", "axes", "signs"), [("Z_UP", [0, 1, 2], 1), ("Y_UP", [0, 2, 1], [1, 1, -1])])
def test_a_collada_file_is_read_in_its_unit_with_its_axis_up(tmp_path, up, axes, signs):
    vertices, faces, volume = crossing_tunnels()
    stated = vertices[:, axes] * signs / 0.0254
    found, _ = read(written(write_collada, tmp_path / "a.dae", stated, faces, 0.0254, up))
    assert found.unit == "in"
    np.testing.assert_allclose(metres_of(found), vertices, atol=1e-5)
    assert trimesh.Trimesh(metres_of(found), found.faces).volume == pytest.approx(volume, abs=1e-3)


def test_a_collada_file_with_x_up_is_turned(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    stated = np.column_stack([vertices[:, 2], -vertices[:, 0], -vertices[:, 1]])
    found, _ = read(written(write_collada, tmp_path / "a.dae", stated, faces, 1.0, "X_UP"))
    np.testing.assert_allclose(metres_of(found), vertices, atol=1e-6)
    assert trimesh.Trimesh(metres_of(found), found.faces).volume == pytest.approx(volume, abs=1e-3)


def test_nodes_of_a_collada_file_place_its_meshes_and_a_mirror_keeps_the_normals_outward(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    moves = (
        lambda scene: scene.TranslateTransform(100.0, 200.0, 50.0),
        lambda scene: scene.RotateTransform(0.0, 0.0, 1.0, 90.0),
        lambda scene: scene.ScaleTransform(1.0, 1.0, -1.0),
    )
    path = written(write_collada, tmp_path / "a.dae", vertices, faces, 1.0, "Z_UP", moves)
    found, _ = read(path)
    placed = np.column_stack([-vertices[:, 1], vertices[:, 0], -vertices[:, 2]]) + np.array([100, 200, 50])
    np.testing.assert_allclose(metres_of(found), placed, atol=1e-5)
    np.testing.assert_allclose(found.vertices.min(axis=0), trimesh.load_scene(path).bounds[0], atol=1e-4)
    assert trimesh.Trimesh(found.vertices, found.faces).volume == pytest.approx(volume, abs=1e-3)


def test_numbers_of_a_collada_file_keep_their_digits_at_map_coordinates(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    path = written(write_collada, tmp_path / "a.dae", vertices, faces, 1.0, "Z_UP")
    text = path.read_text()
    start, end = text.index(">", text.index("<float_array")) + 1, text.index("</float_array>")
    numbers = " ".join(f"{value:.3f}" for value in (vertices + GRID).ravel())
    path.write_text(text[:start] + numbers + text[end:])
    np.testing.assert_allclose(read(path)[0].vertices, vertices + GRID, atol=1e-6)
    assert np.abs(trimesh.load_scene(path).bounds[0] - (vertices + GRID).min(axis=0)).max() > 0.1  # of 32 bits


def test_polygons_of_a_collada_file_need_not_be_convex(tmp_path):
    path = written(write_collada, tmp_path / "a.dae", TEE, [list(range(8))], 1.0, "Z_UP")
    found, _ = read(path)
    areas = trimesh.Trimesh(found.vertices, found.faces, process=False).area
    assert areas == pytest.approx(5.0)


def test_a_collada_file_that_names_another_file_or_no_scene_is_refused(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    path = written(write_collada, tmp_path / "a.dae", vertices, faces, 1.0, "Z_UP")
    text = path.read_text()
    path.write_text(text.replace('url="#drift"', 'url="other.dae#drift"'))
    with pytest.raises(InputError, match=r"its scene names 'other\.dae#drift', which is not in the file"):
        read(path)
    path.write_text(text.replace("instance_visual_scene", "nothing"))
    with pytest.raises(InputError, match=r"names no scene"):
        read(path)


@pytest.mark.parametrize("suffix", [".usd", ".usda", ".usdc"])
def test_a_usd_file_is_read_in_its_unit_with_its_instances_and_without_what_is_hidden(tmp_path, suffix):
    vertices, faces, volume = crossing_tunnels()
    found, remarks = read(written(write_usd, tmp_path / f"a{suffix}", vertices, faces, 1.0, "Z"))
    low, high = metres_of(found).min(axis=0), metres_of(found).max(axis=0)
    np.testing.assert_allclose([low, high], [vertices.min(axis=0), vertices.max(axis=0) * [1, 1, 0] + [0, 0, 20]])
    assert trimesh.Trimesh(found.vertices, found.faces).volume == pytest.approx(2 * volume, rel=1e-5)
    assert sorted(found.layers) == ["/Above/drift", "/Rock/drift"]
    assert remarks == f"a{suffix}: not read: 1 invisible"


def test_a_usd_file_without_a_unit_is_in_centimetres_with_y_up_and_says_so(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    found, remarks = read(written(write_usd, tmp_path / "a.usda", vertices, faces, None, None))
    assert (found.unit, found.up) == ("cm", "y")
    assert "states no metersPerUnit: a unit is a centimetre (--unit), no upAxis: y is up (--up)" in remarks


def test_a_usd_file_that_names_other_files_is_refused_with_the_program_that_joins_them(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    path = written(write_usd, tmp_path / "a.usda", vertices, faces, 1.0, "Z")
    path.write_text(path.read_text().replace("(", "(\n    subLayers = [@./b.usda@]\n", 1))
    with pytest.raises(InputError, match=r"a\.usda: names other files, the first '\./b\.usda'; `usdcat -f"):
        read(path)


def test_an_omf_project_is_read_in_its_unit_from_its_origins_with_what_is_not_read(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    origins = (GRID / 0.3048).tolist(), [10.0, 20.0, 30.0]
    write_omf(tmp_path / "a.omf", vertices / 0.3048, faces, "ft", origins)
    found, remarks = read(tmp_path / "a.omf")
    moved = vertices + GRID + np.array([10, 20, 30]) * 0.3048
    np.testing.assert_allclose(metres_of(found), moved, atol=1e-6)
    assert trimesh.Trimesh(metres_of(found) - GRID, found.faces).volume == pytest.approx(volume, abs=1e-3)
    assert remarks == "a.omf: its triangulated surfaces are read; PointSet are not"


@pytest.mark.parametrize(
    ("unit", "metres"), [("Feet", 0.3048), ("inches", 0.0254), ("us-ft", 1200 / 3937), ("USSurveyFoot", 1200 / 3937)]
)
def test_a_unit_of_an_omf_project_has_the_names_that_programs_write(tmp_path, unit, metres):
    vertices, faces, _ = crossing_tunnels()
    found, _ = read(written(write_omf, tmp_path / "a.omf", vertices / metres, faces, unit))
    np.testing.assert_allclose(metres_of(found), vertices, atol=1e-9)


def test_an_omf_project_in_a_unit_of_no_length_is_refused(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    with pytest.raises(InputError, match=r"its unit is 'degrees', which is none of length"):
        read(written(write_omf, tmp_path / "a.omf", vertices, faces, "degrees"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('stride="3"', 'stride="nan"', r"<accessor> stride is 'nan'; want 1 whole numbers"),
        ('stride="3"', 'stride="1e300"', r"<accessor> stride is '1e300'; want 1 whole numbers"),
        ('stride="3"', f'stride="{2**62}"', rf"<accessor> has stride {2**62} and offset 0"),
        ('<input offset="0"', '<input offset="-1"', r"<triangles> has inputs of offsets \[-1\]; want 0 or more"),
        ("<p>", "<p>1.7 1 2 ", r"<triangles> is '1\.7 1 2 .*; want whole numbers"),
        ("<p>", "<p>99999999999999999999 1 2 ", r"<triangles> is '9999.*; want whole numbers"),
        ("<p>", "<p>0 ", r"<triangles> lists \d+ numbers, of 3 each"),
        ('places-array">', 'places-array">7 ', r"<float_array> states \d+ numbers and has \d+"),
        ('<float_array count="', '<float_array count="99999999', r"<float_array> states 99999999\d+ numbers and has"),
    ],
)
def test_a_number_of_a_collada_file_that_would_move_all_behind_it_is_refused(tmp_path, old, new, message):
    vertices, faces, _ = crossing_tunnels()
    path = written(write_collada, tmp_path / "a.dae", vertices, faces)
    assert path.read_text().count(old) == 1
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=message):
        read(path)


def instanced(path, vertices, faces, kinds, places, prototype=""):
    """Write a mesh by usd-core, and an instancer whose prototype has it."""
    text = written(write_usd, path, vertices, faces).read_text()
    text = text[: text.index('def Xform "Above"')].replace('def "Rock"', 'class "Rock"')
    path.write_text(
        f"""{text}
def PointInstancer "Field"
{{
    int[] protoIndices = {kinds}
    point3f[] positions = {places}
    rel prototypes = </Field/Kind>
    def Xform "Kind"
    {{
        def Xform "Part" (
            instanceable = true
            references = </Rock>
        )
        {{
        }}
        {prototype}
    }}
}}
"""
    )
    return path


def test_instances_of_a_usd_prototype_that_is_an_instance_itself_are_read(tmp_path):
    vertices, faces, volume = crossing_tunnels()
    cone = 'def Cone "Mark"\n{\n}'
    found, remarks = read(instanced(tmp_path / "a.usda", vertices, faces, [0, 0], [(0, 0, 0), (0, 0, 20)], cone))
    assert trimesh.Trimesh(found.vertices, found.faces).volume == pytest.approx(2 * volume, rel=1e-5)
    assert found.vertices[:, 2].max() == pytest.approx(vertices[:, 2].max() + 20)
    assert remarks == "a.usda: not read: 1 Cone of an instance"


@pytest.mark.parametrize(("kinds", "places"), [([0, 0], [(0, 0, 0)]), ([5], [(0, 0, 0)]), ([-1], [(0, 0, 0)])])
def test_instances_of_a_usd_file_that_do_not_fit_its_prototypes_are_refused(tmp_path, kinds, places):
    vertices, faces, _ = crossing_tunnels()
    with pytest.raises(InputError, match=r"/Field: its instances, places and prototypes do not fit each other"):
        read(instanced(tmp_path / "a.usda", vertices, faces, kinds, places))


def test_a_usd_file_with_another_axis_up_than_usd_has_is_refused(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    path = written(write_usd, tmp_path / "a.usda", vertices, faces)
    path.write_text(path.read_text().replace('upAxis = "Z"', 'upAxis = "X"'))
    with pytest.raises(InputError, match=r"a\.usda: upAxis is 'x'; want Y or Z"):
        read(path)


def test_a_unit_without_a_name_is_read_in_metres_and_listed(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    found, remarks = read(written(write_collada, tmp_path / "a.dae", vertices / 0.5, faces, 0.5, "Z_UP"))
    assert found.unit == "m"
    np.testing.assert_allclose(found.vertices, vertices, atol=1e-5)
    assert "states a unit of 0.5 m; its coordinates are read in metres" in remarks


def test_a_solid_that_states_its_unit_is_detected_without_a_guess(tmp_path):
    vertices, faces, _ = crossing_tunnels()
    path = written(
        write_landxml, tmp_path / "a.xml", vertices[:, [1, 0, 2]] / 0.3048, faces, '<Imperial linearUnit="foot"/>'
    )
    with collect_remarks() as remarks:
        found = detect_survey(path, StatedOptions())
    assert (found.values["kind"], found.values["unit"]) == ("solid", "ft")
    assert not [remark.line() for remark in remarks if "states no unit" in remark.line()]
