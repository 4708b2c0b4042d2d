"""What surveys of stations state about their coordinates: Survex, Therion, Compass and Walls."""

from __future__ import annotations

from pipeline.survey.stated.statement import Statement

_ADJUSTMENT = "tests/survey/survex/test_adjustment.py::"
_TIES = "tests/survey/passages/test_ties.py::"
_THERION, _STATED = "tests/survey/solved/test_therion.py::", "tests/survey/therion/test_therion_statements.py::"
_PASSAGES, _SOLVED = "tests/survey/passages/test_passages.py::", "tests/survey/solved/test_solved.py::"
_COMPASS, _WALLS = "tests/survey/compass/test_compass.py::", "tests/survey/walls/test_walls_project.py::"
_PLACES = f"{_STATED}test_a_statement_puts_stations_where_therion_does"

STATEMENTS: tuple[Statement, ...] = (
    Statement(
        ".svx",
        "units, corrections and declinations of readings",
        "used",
        "`cavern` applies `*units`, `*calibrate` and `*declination`.",
        f"{_PASSAGES}test_stations_are_where_units_calibrations_and_declinations_put_them",
    ),
    Statement(
        ".svx",
        "computed declination",
        "used",
        "The model, the dates and the values of `*declination auto` are listed; `--declination` overrules it.",
        f"{_ADJUSTMENT}test_a_computed_declination_is_listed_with_its_model_its_dates_and_its_values",
    ),
    Statement(
        ".svx",
        "date after the last year of the model of the earth's field",
        "listed",
        "The declination is that of the model all the same; `--declination` states another.",
        f"{_ADJUSTMENT}test_dates_after_the_last_year_of_the_model_are_listed",
    ),
    Statement(
        ".svx",
        "coordinate system that a version of Survex turns by a right angle",
        "refused",
        "State the stations in another system (UTM), or the declination as a number.",
        f"{_SOLVED}test_bearings_that_survex_turns_by_a_right_angle_are_refused",
    ),
    Statement(
        ".svx",
        "deviations of fixed stations",
        "used",
        "Fixed stations move as `cavern` moves them, and legs are as long as it prints.",
        f"{_ADJUSTMENT}test_a_traverse_between_two_fixes_with_deviations_begins_at_its_station",
    ),
    Statement(
        ".svx",
        "loops and traverses that do not close",
        "listed",
        "The misclosure is shared out by the deviations; the worst ones are listed with their stations.",
        f"{_ADJUSTMENT}test_what_does_not_close_is_listed",
    ),
    Statement(
        ".svx",
        "surveys that hang on no fixed station",
        "refused",
        "Survex 1.4.9 and older refuse them: tie the named station. Newer ones leave them out, and they are listed.",
        f"{_ADJUSTMENT}test_an_untied_survey_is_refused_with_its_station_and_the_advice_works",
    ),
    Statement(
        ".svx",
        "legs flagged duplicate",
        "used",
        "They tie passages, and are built only where nothing else leads to what hangs on them.",
        f"{_TIES}test_a_repeated_leg_is_built_if_nothing_else_leads_to_what_hangs_on_it",
    ),
    Statement(
        ".svx",
        "two readings of a leg, the first flagged duplicate",
        "used",
        "Their mean is a passage.",
        f"{_TIES}test_the_passage_of_two_readings_stays_if_the_first_alone_is_flagged",
    ),
    Statement(
        ".svx",
        "legs flagged surface",
        "used",
        "They are no passages, and tie none.",
        f"{_TIES}test_a_leg_on_the_surface_ties_nothing",
    ),
    Statement(
        ".svx",
        "entrances and equated stations",
        "used",
        "Equated stations are one station; it is open if one of its names is an entrance.",
        f"{_TIES}test_an_entrance_is_open_whichever_of_its_names_the_legs_have",
    ),
    Statement(
        ".svx",
        "compass readings beyond 360 deg",
        "listed",
        "They go on round the circle.",
        f"{_THERION}test_compass_readings_beyond_the_circle_go_on_round_it_and_are_listed",
    ),
    Statement(
        ".3d",
        "deviations of fixed stations",
        "used",
        "A traverse that begins at a stated place begins at the fixed station nearest to it.",
        f"{_ADJUSTMENT}test_the_length_of_the_legs_is_the_one_that_cavern_prints",
    ),
    Statement(".th", "factor of a unit", "used", "A unit without a factor keeps the one before.", _PLACES),
    Statement(".th", "units and corrections of places", "used", "`fix` follows `units position`.", _PLACES),
    Statement(".th", "deviations of places", "used", "One, two or three deviations of `fix` weigh it.", _PLACES),
    Statement(
        ".th",
        "several places of one station",
        "listed",
        "Their mean is taken, weighted by their deviations.",
        f"{_STATED}test_two_exact_places_of_a_station_are_averaged_and_listed",
    ),
    Statement(".th", "deviations of readings, grades", "used", "`sd` and `grade` weigh loops.", _PLACES),
    Statement(
        ".th",
        "grade that is not defined",
        "listed",
        "Readings have the usual deviations.",
        f"{_STATED}test_a_grade_of_the_project_itself_weighs_and_an_unknown_one_is_listed",
    ),
    Statement(
        ".th",
        "declinations by date",
        "used",
        "They are linear between the dates, at the middle of the dates of a centreline.",
        f"{_STATED}test_a_list_of_declinations_is_read_at_the_date_of_the_centreline",
    ),
    Statement(
        ".th",
        "declinations by date for data without one",
        "listed",
        "The mean over time is taken.",
        f"{_STATED}test_the_mean_of_a_list_is_listed_for_data_without_a_date",
    ),
    Statement(
        ".th",
        "several dates of one centreline",
        "used",
        "The declination is that of the middle between the first and the last.",
        f"{_STATED}test_the_computed_declination_is_that_of_the_middle_of_all_dates_of_a_centreline",
    ),
    Statement(
        ".th",
        "axes to the west and the south",
        "used",
        "Coordinates are turned to the east and the north, Therion's order to the west first.",
        f"{_STATED}test_the_axes_of_krovaks_grid_are_read_by_their_directions",
    ),
    Statement(
        ".th",
        "coordinate system that counts in feet",
        "refused",
        "State the stations in a system of metres or of degrees.",
        f"{_THERION}test_a_centreline_that_cannot_be_converted_is_refused_with_file_and_line",
    ),
    Statement(".th", "vectors under a declination", "used", "They turn like bearings.", _PLACES),
    Statement(".th", "names of a centreline's stations", "used", "`station-names` goes round them.", _PLACES),
    Statement(".th", "flags of two readings of one shot", "used", "The passage has those of both.", _PLACES),
    Statement(
        ".mak",
        "zone and datum without a fixed station",
        "listed",
        "Places are counted from the first station, or it is put at the base location.",
        f"{_COMPASS}test_a_project_without_a_fixed_station_is_read",
    ),
    Statement(
        ".mak",
        "datum without an EPSG code",
        "listed",
        "Coordinates are of a local grid.",
        f"{_COMPASS}test_equal_names_that_are_no_links_and_datums_without_a_code_are_warned_of",
    ),
    Statement(
        ".plt",
        "ends of splays",
        "used",
        "Stations named `.` or `-`, or not at all, measure walls.",
        f"{_PASSAGES}test_ends_of_splays_in_a_plot_file_are_walls_and_no_drifts",
    ),
    Statement(
        ".srv, .wpj",
        "cross-sections, their unit, order and station",
        "used",
        "`<L,R,U,D>` by `S=` and `LRUD=` of `#units`, also in `.OPTIONS` of a project.",
        f"{_WALLS}test_cross_sections_have_their_units_order_and_station",
    ),
    Statement(
        ".srv, .wpj",
        "a survey, with Survex before 1.4.9",
        "refused",
        "Install Survex 1.4.9 or newer: older versions do not read Walls.",
        f"{_WALLS}test_an_older_survex_is_named_as_the_reason",
    ),
)
