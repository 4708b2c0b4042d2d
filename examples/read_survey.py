"""Print what a survey holds: `python examples/read_survey.py cave.th`. It needs `minesurveys` alone."""

import argparse

import numpy as np
import shapely

import minesurveys

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("file", nargs="?", default="data/wheal_pell/pell.3d")
survey = minesurveys.read(parser.parse_args().file)

match type(survey).__name__:
    case "SolvedSurvey":  # stations in metres, and the legs between them
        kept = survey.centreline()  # without splays and repeated legs
        start, end = survey.positions_m[survey.legs[kept]].transpose(1, 0, 2)
        low, high = survey.positions_m[:, 2].min(), survey.positions_m[:, 2].max()
        sections = sum(len(passage.stations) for passage in survey.passages)
        print(f"{len(survey.names)} stations, {sections} cross-sections, {len(kept)} legs")
        print(f"{np.linalg.norm(end - start, axis=1).sum():.1f} m of legs, from {low:.1f} to {high:.1f} m")
        print(f"coordinate system {survey.crs}")
    case "Shapes":  # polygons and lines in the file's unit
        area = sum(shape.area for shape in survey.shapes)
        print(f"{len(survey.shapes)} shapes, {area:.1f} square units")
        print(f"unit {survey.unit}, coordinate system {survey.crs}")
        print(f"bounds {shapely.total_bounds(survey.shapes).round(1).tolist()}")
    case "Triangles":
        print(f"{len(survey.faces)} triangles, unit {survey.unit}, up is {survey.up}")
    case "PointBlock":
        print(f"{len(survey.points)} points from {survey.points.min(axis=0)} to {survey.points.max(axis=0)}")
    case other:
        print(other)
