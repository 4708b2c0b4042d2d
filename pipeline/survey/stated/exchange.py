"""What LandXML, Collada, USD, OMF, KML, GPX, Therion's projects and models, PTX and OctoMap state."""

from __future__ import annotations

from pipeline.survey.stated.statement import Outcome, Statement

_SOLIDS = "tests/survey/solids/test_exchanged_solids.py"
_CLOUDS = "tests/scans/test_exchanged_clouds.py"
_EARTH = "tests/survey/vector/test_kml_gpx.py"
_THERION = "tests/survey/solved/test_therion_models.py"
_USD = ".usd, .usda, .usdc"
_TREES = ".bt, .ot"
_LANDXML_UNITS = "test_landxml_is_northing_first_in_the_units_that_it_states_for_lengths_and_elevations"

_ROWS: tuple[tuple[str, str, Outcome, str, str, str], ...] = (
    (".xml, .landxml", "unit of lengths (linearUnit), also the US survey foot", "used",
     "Coordinates have it; an unknown one is refused.", _SOLIDS, _LANDXML_UNITS),
    (".xml, .landxml", "unit of elevations (elevationUnit)", "used",
     "Elevations have it where it is another than that of lengths, and a remark says so.", _SOLIDS, _LANDXML_UNITS),
    (".xml, .landxml", "axes: northing, easting, elevation", "used", "They are the format's own rule.",
     _SOLIDS, _LANDXML_UNITS),
    (".xml, .landxml", "faces that are invisible (i=1)", "used", "They are left out and counted.",
     _SOLIDS, "test_faces_of_landxml_that_are_marked_invisible_are_left_out_and_counted"),
    (".xml, .dae, .kml, .kmz, .gpx", "a document type (DOCTYPE)", "refused",
     "It could expand texts and name other files; delete it from the file.",
     _SOLIDS, "test_a_broken_landxml_file_is_refused_by_what_is_wrong"),
    (".xml, .landxml", "surfaces of a floor or a terrain", "used", "--heights FILE reads them with a plan.",
     "tests/survey/test_surfaces.py", "test_a_landxml_surface_in_feet_gives_the_floor_of_a_plan_in_metres"),
    (".dae", "unit (unit meter)", "used", "Coordinates have it; without one a unit is a metre, by the format's rule.",
     _SOLIDS, "test_a_collada_file_is_read_in_its_unit_with_its_axis_up"),
    (".dae, .omf, .usd, .usda, .usdc, .xml", "a unit that is none of m, cm, mm, ft, in", "used",
     "Coordinates are read in metres, with a remark.",
     _SOLIDS, "test_a_unit_without_a_name_is_read_in_metres_and_listed"),
    (".dae", "axis that points up (up_axis): x, y or z", "used", "The mesh is turned; without one it is y.",
     _SOLIDS, "test_a_collada_file_with_x_up_is_turned"),
    (".dae", "place, turn, scale and mirror of a mesh in its scene", "used", "Each mesh is moved to its place.",
     _SOLIDS, "test_nodes_of_a_collada_file_place_its_meshes_and_a_mirror_keeps_the_normals_outward"),
    (".dae", "all digits of coordinates", "used", "They are read in 64 bits.",
     _SOLIDS, "test_numbers_of_a_collada_file_keep_their_digits_at_map_coordinates"),
    (".dae", "meshes in other files", "refused", "Export the scene as one file.",
     _SOLIDS, "test_a_collada_file_that_names_another_file_or_no_scene_is_refused"),
    (_USD, "unit (metersPerUnit) and axis that points up (upAxis)", "used",
     "The mesh has them; without them a unit is a centimetre and y is up, by the format's rule, with a remark.",
     _SOLIDS, "test_a_usd_file_without_a_unit_is_in_centimetres_with_y_up_and_says_so"),
    (_USD, "places of meshes, instances and point instancers", "used", "Each mesh is moved to its places.",
     _SOLIDS, "test_a_usd_file_is_read_in_its_unit_with_its_instances_and_without_what_is_hidden"),
    (_USD, "what is invisible, a guide or a proxy", "used", "It is left out and counted.",
     _SOLIDS, "test_a_usd_file_is_read_in_its_unit_with_its_instances_and_without_what_is_hidden"),
    (_USD, "layers and references in other files", "refused", "`usdcat -f IN -o OUT.usdc` writes one file.",
     _SOLIDS, "test_a_usd_file_that_names_other_files_is_refused_with_the_program_that_joins_them"),
    (".omf", "unit, and origins of the project and of a surface", "used", "Coordinates follow them.",
     _SOLIDS, "test_an_omf_project_is_read_in_its_unit_from_its_origins_with_what_is_not_read"),
    (".omf", "points, lines, grids and block models", "listed", "They are not read.",
     _SOLIDS, "test_an_omf_project_is_read_in_its_unit_from_its_origins_with_what_is_not_read"),
    (".kml, .kmz", "coordinate system: longitude and latitude", "used", "Degrees are projected, with a remark.",
     _EARTH, "test_shapes_that_gdal_writes_are_read_where_they_are"),
    (".kml, .kmz", "altitudeMode absolute", "used", "Heights are elevations in metres.",
     _EARTH, "test_elevations_of_kml_count_only_where_its_altitude_mode_is_absolute"),
    (".kml, .kmz", "altitudeMode clampToGround, relativeToGround, or none", "listed",
     "Heights are no elevations; the shape is read without.",
     _EARTH, "test_elevations_of_kml_count_only_where_its_altitude_mode_is_absolute"),
    (".kml, .kmz", "shapes that are not visible", "used", "They are left out and counted; --layer NAME reads them.",
     _EARTH, "test_a_shape_of_kml_that_is_not_visible_is_read_if_its_layer_is_named"),
    (".kml, .kmz", "links to other files, overlays, models", "listed", "They are counted and not read.",
     _EARTH, "test_what_a_kml_file_has_elsewhere_is_counted"),
    (".gpx", "elevations (ele) in metres", "used", "They are those of the line, if each of its points has one.",
     _EARTH, "test_tracks_of_gpx_that_gdal_writes_keep_their_elevations"),
    (".gpx", "a point without an elevation", "listed", "Its line is read without any.",
     _EARTH, "test_a_line_of_gpx_with_a_point_that_has_no_elevation_is_read_without_any"),
    (".gpx", "waypoints", "listed", "They are counted.",
     _EARTH, "test_a_line_of_gpx_with_a_point_that_has_no_elevation_is_read_without_any"),
    (".thconfig", "sources, by name or in the file", "used", "They are read as one survey.",
     _THERION, "test_the_file_of_a_therion_project_is_read_by_its_sources"),
    (".thconfig", "surveys that are selected; loop-closure", "listed", "All sources are read; Survex closes the loops.",
     _THERION, "test_the_file_of_a_therion_project_is_read_by_its_sources"),
    (".lox", "flags of legs and stations: surface, duplicate, splay, entrance, fixed", "used",
     "Each leg and station keeps its flags.",
     _THERION, "test_a_model_of_therion_has_the_stations_legs_and_flags_of_its_source"),
    (".lox", "distances to walls at both ends of a leg", "used", "They are the passage's cross-sections.",
     _THERION, "test_a_model_of_therion_has_the_measured_distances_to_walls"),
    (".lox", "wall surfaces, terrain, pictures", "listed", "They are counted and not read.",
     _THERION, "test_a_model_of_therion_says_what_of_it_is_not_read"),
    (".ptx", "transformation of each scan", "used", "Points are moved by it; one that is no rotation is refused.",
     _CLOUDS, "test_points_of_a_ptx_file_are_where_lastools_has_them_and_directions_without_a_return_are_counted"),
    (".ptx", "directions without a return (0 0 0, NaN)", "used", "They are left out and counted.",
     _CLOUDS, "test_each_scan_of_a_ptx_file_has_its_own_transformation"),
    (_TREES, "resolution", "used", "Points are the middles of occupied voxels; the surface is found to it.",
     _CLOUDS, "test_occupied_voxels_of_a_tree_are_points_at_their_middles"),
    (_TREES, "leaves larger than a voxel", "used", "They have the voxels on their faces.",
     _CLOUDS, "test_a_leaf_of_many_voxels_has_those_on_its_faces"),
    (".ptx, .bt, .ot, .e57", "no unit: their formats count in metres", "listed",
     "Coordinates are metres, with the size in a remark; --unit states another.",
     _CLOUDS, "test_formats_that_count_in_metres_are_no_guess"),
    (_TREES, "which voxels are free, and how certain", "listed",
     "The free space is found between the points, as of a scan.",
     _CLOUDS, "test_the_free_space_of_a_tree_is_built_as_that_of_a_scan"),
)  # fmt: skip

STATEMENTS: tuple[Statement, ...] = tuple(
    Statement(form, states, outcome, how, f"{file}::{test}") for form, states, outcome, how, file, test in _ROWS
)
