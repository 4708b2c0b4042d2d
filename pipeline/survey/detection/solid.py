"""Detect unit, origin and detail of a solid of workings."""

from __future__ import annotations

from pathlib import Path

from minesurveys.formats import files_of
from pipeline.params.stated import StatedOptions
from pipeline.params.survey import SolidSurveyParams
from pipeline.survey.detection.detected_section import Detection, section_for


def detect_solid(path: Path, stated: StatedOptions) -> Detection:
    """Read triangles as the surface of the workings.

    Raises
    ------
    InputError
        If they cannot be read, or have a hole wider than `--close` allows.
    """
    from pipeline.survey.detection.unstated import facets_of_mesh, warn_of_guesses
    from pipeline.survey.solids.read import read_solid  # trimesh and ezdxf take a second to load

    options = stated.model_dump(include={"layers", "unit", "close_m", "up", "simplify_m"}, exclude_none=True)
    params = section_for(SolidSurveyParams, path, {"kind": "solid", **options})
    read = read_solid(params, is_stated=False)
    facets = facets_of_mesh(read.solid.vertices, read.solid.faces)
    warn_of_guesses(path, facets, read.unit_is_guess, read.up_is_guess)
    place = read.georeference
    values = {
        "kind": "solid",
        "file": path.name,
        "layers": stated.layers,
        "unit": place.unit,
        "up": stated.up,
        "origin": [*place.origin, read.solid.datum_m / place.metres_per_unit],
        "close_m": params.close_m,
        "simplify_m": read.simplify_m,
    }
    remarks = {
        "origin": "of the mine frame, in the file's coordinates",
        "close_m": "holes up to this width are closed, m",
        "simplify_m": "no corner moves by more if facets are many; beyond 0.001 four fifths, as of scans, m",
        "up": "axis of the file that points up; null: as the file or its format states, else z",
    }
    width_m = 2 * read.workings.area / read.workings.length
    return Detection(values, remarks, files_of(path), width_m, has_heights=True)
