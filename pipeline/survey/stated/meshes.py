"""What meshes, DXF drawings, occupancy maps, point clouds other than LAS, and station tables state."""

from __future__ import annotations

from pipeline.survey.stated.statement import Outcome, Statement

_POLYLINES = "tests/survey/vector/test_dxf_polylines.py"
_BLOCKS = "tests/survey/vector/test_dxf_blocks.py"
_VECTOR = "tests/survey/vector/test_vector_files.py"
_MAPS = "tests/survey/grid/test_nav2.py"
_POINTS = "tests/scans/test_measured_points.py"
_CLOUDS = "tests/scans/test_more_clouds.py"
_PRECISION = "tests/survey/solids/test_solid_precision.py"
_SOLIDS = "tests/survey/solids/test_solid_files.py"
_SURVEY = "tests/survey/solids/test_solid_survey.py"
_STATIONS = "tests/survey/stations/test_stations.py"
_COLUMNS = "tests/survey/stations/test_table_columns.py"

_ROWS: tuple[tuple[str, str, Outcome, str, str, str], ...] = (
    (".dxf", "unit ($INSUNITS): m, cm, mm, ft, in, US survey ft and in", "used",
     "Lengths are converted from it, the US survey foot as the foot: 2 mm in a kilometre.",
     _POLYLINES, "test_a_stated_unit_is_used_or_named"),
    (".dxf", "unit ($INSUNITS): miles, yards, kilometres, decimetres and others", "listed",
     "It is not read; --unit states one that is.", _POLYLINES, "test_a_stated_unit_is_used_or_named"),
    (".dxf", "how lengths are shown ($LUNITS: feet and inches); English units ($MEASUREMENT = 0)", "listed",
     "They change nothing: listed where the unit is none of feet and inches.",
     _POLYLINES, "test_english_units_that_a_drawing_only_shows_are_listed"),
    (".dxf", "points of the frame of a fitted curve or surface (flag 16)", "used",
     "The curve is read, its frame is left out, as in GDAL.",
     _POLYLINES, "test_the_frame_of_a_fitted_spline_is_no_line"),
    (".dxf", "ways along which a polygon mesh closes", "used",
     "Its last row or column is joined to its first.",
     _POLYLINES, "test_a_polygon_mesh_that_closes_along_one_way_is_a_tube_with_two_open_ends"),
    (".dxf", "arcs of polylines (bulge), fitted ones too", "used", "They are read as chords.",
     _POLYLINES, "test_the_arcs_of_a_curve_that_was_fitted_by_arcs_are_read_with_its_extra_points"),
    (".dxf", "axes of an entity (extrusion)", "used", "Its points are turned into the drawing's axes.",
     _POLYLINES, "test_a_polyline_in_a_mirrored_system_lies_where_gdal_reads_it"),
    (".dxf", "layers that are off or frozen", "used", "They are left out and listed; --layer NAME reads one.",
     _BLOCKS, "test_lines_on_a_layer_that_is_off_or_frozen_are_left_out_with_a_remark_unless_it_is_named"),
    (".dxf", "clips of block references", "listed", "The block is read whole; explode and trim it in CAD.",
     _BLOCKS, "test_a_clip_of_a_block_reference_is_warned_of_as_the_block_is_read_whole"),
    (".dxf", "external references", "listed", "Drawings outside the file are not read; bind them in CAD.",
     _BLOCKS, "test_an_external_reference_is_named_as_its_drawing_is_not_in_the_file"),
    (".dxf", "widths of polylines", "listed", "The line is read; --half-width M makes drifts of it.",
     _VECTOR, "test_walls_that_are_drawn_with_a_width_are_lines"),
    (".glb", "unit and axes: metres, y up", "used", "They are the format's own rule.",
     _PRECISION, "test_the_place_of_a_mesh_in_a_glb_scene_makes_it_no_coarser"),
    (".glb", "place, turn and mirror of a mesh in its scene", "used", "Each mesh is moved to its place.",
     _SOLIDS, "test_a_mesh_that_its_place_in_a_scene_mirrors_keeps_its_sense"),
    (".stl, .ply", "numbers of 32 bits", "refused",
     "Coordinates in steps of more than 1 cm are refused, of more than 1 mm listed; export them with a local origin.",
     _PRECISION, "test_a_mesh_of_32_bits_in_map_coordinates_is_refused_and_read_with_a_local_origin"),
    (".obj, .stl, .ply", "unit in a comment, or in the header of STL", "used",
     "A line such as `# File units = inches` gives the unit, with a remark; --unit overrules it.",
     _SOLIDS, "test_a_unit_that_a_comment_states_is_used_and_listed"),
    (".dxf", "place on the Earth (GEODATA)", "listed", "Coordinates are those of the drawing.",
     _POLYLINES, "test_a_place_on_the_earth_is_listed"),
    (".obj, .stl, .ply", "no unit and no axis that points up", "listed",
     "They are read as metres with z up; --unit and --up state others.",
     _SURVEY, "test_a_file_with_y_up_is_noticed_and_turned_by_the_option"),
    (".obj, .ply, .dxf", "faces of more than three corners", "used",
     "They are cut into triangles inside their outlines, convex or not.",
     "tests/scans/test_polygons.py",
     "test_faces_that_are_not_convex_close_the_solid_whatever_corner_they_begin_with"),
    ("map .yaml", "resolution, origin and yaw", "used", "Cells are placed by them.",
     _MAPS, "test_opacity_is_read_by_the_maps_mode_as_map_server_does"),
    ("map .yaml", "mode, negate and the two thresholds", "used", "Cells are free by map_server's rules.",
     _MAPS, "test_negated_maps_raw_maps_and_unknown_cells_are_read"),
    ("map .yaml", "opacity of the picture", "used",
     "In the mode scale cells that are not opaque are unknown; in trinary opacity counts as a fourth colour.",
     _MAPS, "test_opacity_is_read_by_the_maps_mode_as_map_server_does"),
    ("map .yaml", "largest value of a PGM (maxval)", "used", "It is white.",
     _MAPS, "test_a_pgm_has_the_white_that_its_header_states"),
    (".pcd, .ply, .xyz", "points that are NaN, or lie at 0 0 0", "used", "They are left out and counted.",
     _POINTS, "test_points_that_are_nan_or_lie_at_0_0_0_are_left_out_and_counted"),
    (".pcd", "rows and columns of an organised cloud (WIDTH, HEIGHT)", "used", "Their product is the number of points.",
     _POINTS, "test_an_organised_cloud_has_width_times_height_points"),
    (".pcd", "place and turn of the scanner (VIEWPOINT)", "listed", "It moves no point, as in PCL and Open3D.",
     _POINTS, "test_a_viewpoint_is_named_and_moves_no_point_as_in_open3d"),
    (".pcd, .ply", "numbers of 32 bits", "refused",
     "Points in steps of more than 1 cm are refused, of more than 1 mm listed; export them with a local origin.",
     _POINTS, "test_a_cloud_of_32_bits_in_map_coordinates_is_refused_and_read_with_a_local_origin"),
    (".pts", "number of points above each scan", "used", "Scans are joined; a number that is not theirs is listed.",
     _POINTS, "test_a_pts_file_of_several_scans_has_a_count_above_each"),
    (".e57", "place and turn of each scan", "used", "Points are moved into the file's frame.",
     _CLOUDS, "test_the_scans_of_an_e57_file_are_joined_in_its_frame"),
    (".e57", "points that are invalid", "used", "They are left out and counted.",
     _CLOUDS, "test_points_of_an_e57_file_that_are_stated_as_invalid_or_lie_at_the_scanner_are_left_out"),
    (".csv of points", "names of columns", "used", "They say which columns are x, y and z.",
     _CLOUDS, "test_columns_are_found_by_their_names"),
    (".csv of points", "unit in the names of columns", "used", "Coordinates have it; --unit overrules it.",
     _COLUMNS, "test_points_have_the_unit_that_their_columns_state"),
    (".csv of stations", "unit in a column's name: m, cm, mm, ft, usft, in", "used",
     "Columns in other units than metres are converted and listed; an unknown unit in brackets is refused.",
     _COLUMNS, "test_the_unit_in_a_columns_name_is_read"),
    (".csv of stations", "names that total stations give to columns", "used",
     "They are read as ours, and listed; --columns OURS=NAME states others, or numbers where there are no names.",
     _COLUMNS, "test_stated_columns_are_read_in_their_unit_whatever_their_names"),
    (".csv of stations", "points without legs; directions, zenith angles and distances", "refused",
     "The message has the columns, and the option, the column or the lines of Survex that read them.",
     _COLUMNS, "test_directions_and_zenith_angles_are_read_by_survex_as_the_refusal_says"),
    (".csv of stations", "other columns", "listed", "They are not read.",
     _STATIONS, "test_columns_that_are_not_read_are_listed"),
)  # fmt: skip

STATEMENTS: tuple[Statement, ...] = tuple(
    Statement(form, states, outcome, how, f"{file}::{test}") for form, states, outcome, how, file, test in _ROWS
)
