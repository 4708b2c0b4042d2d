"""What LAS, geodata, rasters of heights, PDF pages and georeferenced pictures state."""

from __future__ import annotations

from pipeline.survey.stated.statement import Outcome, Statement

_LAS = "tests/survey/clouds/test_las_statements.py"
_SCANS = "tests/survey/clouds/test_cloud_files.py"
_AXES = "tests/survey/coordinates/test_map_axes.py"
_GROUND = "tests/survey/coordinates/test_ground.py"
_KINDS = "tests/survey/vector/test_other_kinds.py"
_SHOTS = "tests/survey/vector/test_shot_flags.py"
_LEVELS = "tests/survey/vector/test_level_fields.py"
_VECTOR = "tests/survey/vector/test_vector_files.py"
_HEIGHTS = "tests/survey/test_height_rasters.py"
_PAGE = "tests/survey/drawing/test_page_unit.py"
_PICTURES = "tests/survey/drawing/test_pictures.py"
_TURNED = "tests/survey/drawing/test_orientation.py"
_POINTS, _SHAPES, _TABLES = ".las, .laz", ".gpkg, .shp, .geojson, .json", ".gpkg, .shp"
_RASTERS, _TIFF, _PHOTOS = "--heights .tif, .asc", "--heights .tif", "plan .tif, .png, .jpg"

_BY_BAND = "test_heights_of_a_raster_are_those_that_its_band_and_its_vertical_system_state"
_BY_HEIGHT = "test_heights_have_the_unit_and_the_direction_of_their_own_axis"
_BY_TEXT = "test_the_text_of_a_system_states_the_unit_of_the_plan_and_of_heights"
_BY_ZONE = "test_degrees_and_stretched_maps_are_refused_until_the_advised_zone_is_used"
_BESIDE = "test_what_a_file_beside_the_raster_states_is_refused_until_the_advice_is_followed"

_ROWS: tuple[tuple[str, str, Outcome, str, str, str], ...] = (
    (_POINTS, "unit of the plan, in the text of its system (WKT)", "used", "Coordinates have it; --unit overrules it.",
     _LAS, _BY_TEXT),
    (_POINTS, "unit and direction of heights, in a vertical system", "used",
     "Heights have it; without one they have the plan's unit, and a remark says so where that is no metre.",
     _LAS, _BY_TEXT),
    (_POINTS, "units and system in keys of GeoTIFF", "used", "GDAL reads them; a key of a unit comes first.",
     _LAS, "test_the_keys_of_old_records_state_units_too"),
    (_POINTS, "which of two records of the system counts (the flag WKT)", "used", "That record is read.",
     _LAS, "test_of_both_records_the_one_that_the_flag_names_counts"),
    (_POINTS, "axes that point south or west", "used", "East and north are made of them, with a remark.",
     _LAS, "test_a_scan_in_a_system_that_points_south_and_west_is_not_mirrored"),
    (_POINTS, "degrees, a stretched map, or axes from the Earth's centre", "refused",
     "Transform it to the UTM zone that the message names.", _LAS, _BY_ZONE),
    (_POINTS, "scale factor and offset", "used",
     "Coordinates have them; steps of more than 1 cm are listed, a scale factor of 0 is refused.",
     _LAS, "test_coarse_scale_factors_are_listed_and_none_are_refused"),
    (_POINTS, "coordinates at the limit of a record", "refused",
     "They were clamped when the file was written; export it again with an offset near the workings.",
     _LAS, "test_coordinates_clamped_at_the_limit_of_a_record_are_refused_until_the_advice_is_followed"),
    (_POINTS, "points flagged withheld, and points classed as noise (7, 18)", "used", "They are left out and counted.",
     _LAS, "test_points_flagged_withheld_or_classed_as_noise_are_left_out_and_counted"),
    (_POINTS, "points flagged synthetic, key point or overlap", "listed", "They are read as the others.",
     _LAS, "test_points_flagged_withheld_or_classed_as_noise_are_left_out_and_counted"),
    (_POINTS, "times of points", "used", "With --trajectory they say where the scanner was.",
     _SCANS, "test_times_of_points_are_read_where_the_format_has_them"),
    (".zip", "clouds in different systems or units", "refused", "Give them one by one, or convert them to one system.",
     _LAS, "test_clouds_of_one_zip_file_in_two_units_are_refused_and_in_one_are_read"),
    (_TABLES, "unit and direction of heights, in a vertical system", "used",
     "Heights have it; without one they have the plan's unit, and a remark says so where that is no metre.",
     _AXES, _BY_HEIGHT),
    (_TABLES, "name of the vertical system", "listed", "Heights over a geoid and over an ellipsoid are read alike.",
     _AXES, _BY_HEIGHT),
    (_SHAPES, "axes that point south or west", "used", "East and north are made of them, with a remark.",
     _AXES, "test_every_format_with_a_system_that_points_south_and_west_is_read_by_its_axes"),
    (_SHAPES, "degrees or grads, also of the Moon", "used", "They are projected on the system's own ellipsoid.",
     _AXES, "test_degrees_are_projected_on_the_ellipsoid_of_their_own_body"),
    (_SHAPES, "a stretched map, such as Web Mercator", "used", "Lengths are those on the ground, with a remark.",
     _GROUND, "test_a_vector_mine_in_a_stretched_system_has_its_true_area_and_width_and_says_so"),
    (_TABLES, "axes from the Earth's centre", "refused", "Transform it to the UTM zone that the message names.",
     _AXES, "test_coordinates_from_the_earths_centre_are_refused_and_the_advised_zone_is_read"),
    (_SHAPES, "a system that names files (grids)", "refused", "No file beside the survey is opened.",
     _VECTOR, "test_a_coordinate_system_that_names_a_file_is_refused_before_proj_opens_it"),
    (_TABLES, "measures (M)", "listed", "They are not read; x, y and z are.",
     _KINDS, "test_measures_are_dropped_with_their_number_and_the_elevations_stay"),
    (_TABLES, "curves", "used", "They are read as chords, and counted.",
     _KINDS, "test_shapes_that_are_surfaces_or_empty_or_curved_are_counted_beside_a_drift"),
    (_TABLES, "surfaces in space (TIN, MultiPatch)", "refused", "Cut them at the height of the floor.",
     _KINDS, "test_a_multipatch_is_refused_by_its_name_and_not_read_as_polygons"),
    (_TABLES, "layers", "listed", "All are read as one plan; --layer NAME chooses.",
     "tests/survey/vector/test_layer_ways.py",
     "test_the_layer_whose_walls_enclose_a_drift_is_named_with_its_gap_and_the_advice_works"),
    (_TABLES, "properties of shapes", "used", "--level-by FIELD keeps levels apart by one.",
     _LEVELS, "test_a_property_of_a_geopackage_names_levels_too_and_is_written_into_the_survey"),
    (_TABLES, "shots flagged splay or surface (Therion's _SPLAY, _SURFACE)", "used", "They are left out and counted.",
     _SHOTS, "test_splays_and_legs_on_the_surface_are_no_drifts_and_are_counted"),
    (_TABLES, "shots flagged duplicate (Therion's _DUPLICATE)", "used",
     "With --half-width they tie stations, and are no passages of their own.",
     _SHOTS, "test_duplicates_keep_their_flag_as_legs_of_a_survey"),
    (_TIFF, "scale and offset of the band", "used", "Heights are value * scale + offset; a scale of 0 is refused.",
     _HEIGHTS, _BY_BAND),
    (_TIFF, "unit of the band", "used",
     "Heights have it, also where the vertical system states another; a unit that is no length is refused.",
     _HEIGHTS, "test_of_two_units_the_bands_is_used_and_the_other_listed"),
    (_TIFF, "unit and direction of heights, in a vertical system", "used", "Heights have it.", _HEIGHTS, _BY_BAND),
    (_TIFF, "name of the vertical system", "listed", "A survey in the same plan system takes its heights.",
     _HEIGHTS, "test_a_vertical_system_over_a_geoid_is_listed_and_is_no_other_system"),
    (_TIFF, "cells without a value: nodata, mask, alpha", "used", "They are no heights.",
     _HEIGHTS, "test_cells_without_a_value_are_no_heights"),
    (_TIFF, "whether a pixel is an area or a point", "used", "Heights lie where GDAL puts them.",
     _HEIGHTS, "test_pixels_that_are_points_lie_where_gdal_puts_them"),
    (_TIFF, "turned pixels", "used", "Heights lie where the transform puts them.", _HEIGHTS, _BY_BAND),
    (_TIFF, "ground control points", "refused", "`gdalwarp` makes a grid of them.",
     _HEIGHTS, "test_ground_control_points_are_named_as_what_the_georeference_is"),
    (_TIFF, "further bands", "listed", "The first is read; `gdal_translate -b` writes another alone.",
     _HEIGHTS, "test_the_first_of_several_bands_is_read_and_the_others_are_listed"),
    (_TIFF, "colours or a palette", "refused", "Give the raster of elevations that the picture was drawn from.",
     _HEIGHTS, "test_colours_are_no_heights"),
    (_RASTERS, "scale, unit, mask or place in a file beside it (.aux.xml, .msk)", "refused",
     "`gdal_translate` writes them into one file.", _HEIGHTS, _BESIDE),
    (_RASTERS, "another system than the survey's", "refused", "`gdalwarp -t_srs` transforms it.",
     _HEIGHTS, "test_a_raster_in_degrees_or_in_another_system_names_the_transformation"),
    ("--heights .asc", "corner or centre of its first cell, and a .prj with system and unit of heights", "used",
     "Heights lie and are measured by them.",
     _HEIGHTS, "test_the_prj_beside_an_ascii_grid_states_its_system_and_its_unit_of_heights"),
    (".pdf", "size of a unit (UserUnit)", "used", "The page is that much larger, with a remark.",
     _PAGE, "test_a_page_is_as_large_as_its_user_unit_makes_it"),
    (".pdf", "crop box and turn of a page", "used", "The page is read as it is shown.",
     _PAGE, "test_a_turned_and_cropped_page_has_its_user_unit_too"),
    (".pdf", "a measure or a georeference (VP, LGIDict)", "listed", "It is not read; --scale 1:N states the scale.",
     _PAGE, "test_a_measure_of_a_page_is_listed_as_not_read"),
    (".pdf", "a scale 1:N in its text", "used", "It is the scale where there is no bar.",
     _PICTURES, "test_the_scale_that_a_pages_text_states_is_taken_where_there_is_no_bar"),
    (_PHOTOS, "a system beside a world file: .prj, or .aux.xml", "used",
     "A pixel has the unit of the .prj; degrees are refused. A system in .aux.xml is listed with what writes a .prj.",
     _PICTURES, "test_the_system_beside_a_world_file_states_its_unit"),
    (_PHOTOS, "a world file, or the tags of a GeoTIFF", "used", "They give scale, turn and origin.",
     _PICTURES, "test_a_geotiff_gives_the_scale_the_coordinate_system_and_the_origin"),
    ("plan .tif", "axes that point south or west", "used", "East and north are made of them, with a remark.",
     _AXES, "test_a_picture_in_a_system_that_points_south_and_west_is_not_called_mirrored"),
    ("plan .tif", "a stretched map, such as Web Mercator", "used", "Lengths are those on the ground, with a remark.",
     _GROUND, "test_a_picture_in_web_mercator_has_metres_of_the_ground_and_says_so"),
    (_PHOTOS, "which way up it is (Exif)", "used", "It is turned; with a georeference it is refused.",
     _TURNED, "test_a_picture_is_read_as_it_is_to_be_shown"),
    (_PHOTOS, "resolution (dpi)", "used", "With --scale 1:N it gives the scale.",
     _PICTURES, "test_the_scale_of_a_scan_follows_from_its_ratio_and_the_resolution_that_it_states"),
)  # fmt: skip

STATEMENTS: tuple[Statement, ...] = tuple(
    Statement(form, states, outcome, how, f"{file}::{test}") for form, states, outcome, how, file, test in _ROWS
)
