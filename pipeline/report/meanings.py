"""What the figures of `metrics.json` mean: a sentence for each, and the page of the docs that has more."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fnmatch import fnmatchcase

DOCS = "https://github.com/minexplore/minexplore/blob/main/docs/"
_METRICS, _VOLUME = "reference/metrics.md", "reference/heights.md#figures"
_CERTIFICATE, _ROCK = "evidence/certificate.md#the-containment-certificate", "evidence/rock.md#how-it-is-measured"
_SIZE = "evidence/speed.md"


@dataclass(frozen=True)
class FigureGroup:
    """A group of figures: its title and the page of the docs about it."""

    title: str
    page: str

    @property
    def link(self) -> str:
        """Return the address of the page."""
        return DOCS + self.page


GROUPS = {
    "survey": FigureGroup("What of the survey is built", _VOLUME),
    "floor": FigureGroup("Floors against the survey", _VOLUME),
    "drawn": FigureGroup("Floors against the drawing", _VOLUME),
    "solid": FigureGroup("The world against the solid", _VOLUME),
    "scan": FigureGroup("The world against the scan", "how-to/drawings.md"),
    "rays": FigureGroup("The world against the scanner's rays", "how-to/drawings.md"),
    "enclosure": FigureGroup("Rock around the free space", _VOLUME),
    "rock": FigureGroup("Visible rock", _VOLUME),
    "reach": FigureGroup("What robots reach", _VOLUME),
    "standing": FigureGroup("Robots at rest", _VOLUME),
    "drives": FigureGroup("Robots that drive", _VOLUME),
    "robots": FigureGroup("Robots thrown at the rock", _VOLUME),
    "balls": FigureGroup("Balls pushed at the rock", _VOLUME),
    "volume": FigureGroup("Size of the volume", _VOLUME),
    "iou": FigureGroup("Area of the world against the plan", _METRICS),
    "against_plan": FigureGroup("Where world and plan differ", _METRICS),
    "wall_error": FigureGroup("Distance of walls from the plan", _METRICS),
    "navigability": FigureGroup("Floor that the plan shows and the world has", _METRICS),
    "topology": FigureGroup("Drifts of the world against the plan", _METRICS),
    "areas": FigureGroup("Areas of the plan", _METRICS),
    "collision": FigureGroup("Parts that robots collide with", _METRICS),
    "certificate": FigureGroup("Containment certificate", _CERTIFICATE),
    "texture": FigureGroup("Texture of the rock", _ROCK),
    "relief": FigureGroup("Shape of the rock", _ROCK),
    "walls": FigureGroup("Walls that are seen, felt and measured", _METRICS),
    "scale": FigureGroup("Scale of the plan", _METRICS),
    "replay": FigureGroup("Real sweeps in the world", "evidence/certificate.md#lidar-replay"),
    "holdout": FigureGroup("Sweeps that were held back", "evidence/certificate.md#held-out-sweeps"),
    "world": FigureGroup("The files and their load", _SIZE),
    "per_m2": FigureGroup("Size for each square metre of rock", _SIZE),
    "per_metre": FigureGroup("Size for each metre of drift", _SIZE),
}
_MEANINGS = {  # the first pattern counts
    "survey.surveyed_m": "length of all legs of the file",
    "survey.length_m": "length of the piece that is built",
    "survey.built_m": "length of that piece whose floor line is in the free space",
    "survey.share_built": "share of the length of the piece whose floor line is in the free space",
    "survey.unbuilt_m": "longest part of one leg whose floor line is in rock",
    "survey.unbuilt_at": "the leg with the longest such part",
    "survey.pieces": "pieces of the file that share no station",
    "survey.legs": "legs between two stations",
    "survey.entrances": "stations that the file states as open to the surface",
    "survey.closed_ends": "ends of legs that rock closes",
    "survey.least_width_share": "least width along a leg, over the survey's",
    "survey.least_width_at": "where a leg is narrowest beside the survey's width",
    "survey.narrow_share": "share of the legs' length that is narrower than 95 % of the survey's width",
    "survey.narrow_at": "where a leg is narrowest",
    "survey.narrowed_m": "width that the builder takes from a leg beyond 5 % and the tolerance of both walls",
    "survey.narrowed_at": "where that is",
    "survey.reached_share": "share of the workings' area that a robot reaches",
    "survey.cut_off_m": "length of legs that the builder cuts off from the others",
    "survey.cut_off_at": "the first leg that is cut off",
    "survey.stations_in_rock*": "stations that lie in rock: their number, and the deepest",
    "survey.line_in_rock*": "length of the survey's lines that is over 10 cm in rock, and where most",
    "floor.error_mm": "largest distance of the floor from the survey's, under flat legs",
    "floor.median_mm": "median distance of the floor from the survey's, under flat legs",
    "floor.over_1cm": "share of the flat legs whose floor is over 1 cm off, without parts in other workings",
    "floor.step_mm": "highest step where flat legs meet",
    "floor.other_step_mm": "highest step between legs that are over 5 m apart along the survey",
    "floor.steep_share": "share of the floors' area that is steeper than 20 degrees",
    "floor.tracks_mm": "largest distance of the floor from the survey's, 0.25 m beside the legs",
    "floor.steepest": "steepest rise over run of the floor, 0.25 m beside the legs",
    "floor.in_other_workings_share": "share of the drivable length that lies in a deeper working of another leg",
    "floor.in_other_workings": "pairs of legs of which one has its floor in the section of the other",
    "floor.through": "places where the floor of one leg breaks through that of another",
    "floor.ledges": "pairs of legs with a step of over 1 cm between their floors",
    "floor.error_at": "where the floor is farthest from the survey's",
    "floor.step_at": "where the highest step is",
    "drawn.floor_mm": "largest distance of the floor from the drawn one",
    "drawn.median_mm": "median distance of the floor from the drawn one",
    "drawn.step_mm": "highest step across the edges of the drawn floor's triangles",
    "drawn.*": "floors of drawn areas",
    "solid.iou": "volume that world and file share, over the volume of both together",
    "solid.within_*": "share of the file's surface near the world's",
    "solid.lump_m3": "largest lump that one of the two has and the other has not",
    "solid.lump_at": "where that lump is",
    "solid.median_mm": "median distance of the file's surface from the world's",
    "solid.largest_mm": "largest distance of the file's surface from the world's",
    "solid.*": "the world's surface against the file's",
    "scan.points": "points of the scan that were compared",
    "scan.mean_mm": "mean distance of the points from the world's surface; in the rock it is positive",
    "scan.median_mm": "median distance of the points from the world's surface",
    "scan.rms_mm": "root mean square of these distances",
    "scan.seen_share": "share of the world's surface that the scan saw",
    "scan.within_*": "share of the points near the world's surface",
    "scan.*": "points of the scan against the world's surface",
    "rays.rays": "rays of the scanner that were cast again",
    "rays.through_share": "share of the rays that are longer by 30 cm or more in the world",
    "rays.short_share": "share of the rays that are shorter by 30 cm or more in the world",
    "rays.within_*": "share of the rays that are as long in the world",
    "rays.*": "rays of the scanner against those in the world",
    "enclosure.intrusion_mm": "how far a part of the rock is in the free space at most",
    "enclosure.gap_mm": "widest circle on the surface without rock behind it",
    "enclosure.thin_mm": "widest circle on the surface with less than 2 cm of rock behind it",
    "enclosure.*_at": "where that is",
    "enclosure.unbacked": "parts that lie behind no facet",
    "enclosure.surface_m2": "surface of the free space",
    "enclosure.thinnest_mm": "thinnest rock behind a facet",
    "enclosure.full_share": "share of the surface behind which the rock is 0.3 m thick",
    "enclosure.compiled_mm": "distance of parts as MuJoCo compiles them from those of the bundle",
    "enclosure.unlike": "parts that the model has otherwise than the bundle",
    "enclosure.mislabelled": "parts with the friction of floors that stand before no floor, or the other way round",
    "rock.shown": "1 if the world has visible rock, 0 if it shows the walls that robots feel",
    "rock.facets": "triangles of the visible rock",
    "rock.gap_*": "distance of the visible rock from the surface that robots feel",
    "rock.into_free_m": "how far the visible rock is in the free space at most",
    "rock.open_m": "length of the rock's border that is not on the floors' border",
    "rock.bare_m": "length of the floors' border on which no rock stands",
    "rock.crossings": "places where the visible rock crosses itself",
    "rock.folded": "places where the surface that robots feel crosses itself, in 32 bits",
    "rock.leaks": "rays that leave the mine through a gap in the visible rock",
    "rock.narrowest_kept": "share of the clear width that the visible rock leaves in the narrowest passage",
    "reach.share": "share of all floors that the robot reaches from the spawn",
    "reach.of_largest": "floors reached from the spawn, over the largest that can be driven on from anywhere",
    "reach.m2": "floor that the robot reaches from the spawn",
    "reach.level_m2": "floor that is flat and high enough for the robot",
    "reach.floor_m2": "all floors",
    "standing.rest_mm": "way of a robot at rest in 5 s, beyond that on an even plane",
    "standing.climb_share": "share of the robots that gain height when they drive uphill at 0.15 m/s",
    "standing.rest_at": "which robot moved farthest, and where it stood",
    "drives.ways": "ways of 1 m that were drawn",
    "drives.share": "share of the robots that come to the end of their way",
    "*.contacts": "steps of bodies in contact with rock",
    "*.throws": "bodies that were thrown or pushed",
    "*.escapes": "bodies that ended in rock, or outside the workings",
    "volume.facets": "triangles of the free space",
    "volume.parts": "convex parts of rock",
    "volume.free_m3": "free space",
    "volume.storeys": "connected floors that do not pass over themselves",
    "iou.free_space_vs_cleaned": "area that world and cleaned plan share, over the area of both together",
    "iou.free_space_vs_raw": "area that world and plan as read share, over the area of both together",
    "iou.rock": "area of rock that both share, over the area of both together",
    "iou.*": "area that two plans share, over the area of both together",
    "against_plan.rock_in_free_*": "rock of the world where the plan is free",
    "against_plan.missing_rock_m2": "free space of the world where the plan has rock",
    "wall_error.mean_m": "mean distance of the built walls from the traced ones",
    "wall_error.p99_m": "99 % of the traced wall is nearer to the built one than this",
    "wall_error.max_m": "largest distance of the built walls from the traced ones, or the other way round",
    "wall_error.lost_m": "mean distance by which built walls stand inside the traced workings",
    "wall_error.gained_m": "mean distance by which built walls stand outside the traced workings",
    "wall_error.drawn_mean_m": "area that tracing and cleaning changed, for each metre of wall",
    "wall_error.wall_m": "length of all walls",
    "navigability.columns": "columns of the plan's free space that were tested",
    "navigability.blocked": "columns with rock in them that are farther from a wall than simplification explains",
    "navigability.blocked_at_wall*": "the other columns with rock in them: number, and share",
    "navigability.wall_band_m": "how far a wall may differ from the plan by simplification and pixels",
    "navigability.deepest_blocked_m": "how deep in the plan's free space rock is at most",
    "topology.drift_m": "length of the drifts",
    "topology.drifts_*": "drifts of the plan and the world, and those that one of them lacks",
    "topology.loops_*": "loops of the plan and the world, and their difference",
    "topology.components_*": "parts that are not connected",
    "topology.length_*": "length of the drifts in the plan and in the world",
    "topology.*": "drifts of the world against those of the plan",
    "areas.tunnel_m2": "area of the workings",
    "areas.islands_m2": "area of rock inside the workings",
    "areas.outside_m2": "area of rock around the workings",
    "areas.islands": "pieces of rock inside the workings",
    "areas.traced_tunnel_m2": "area of the workings before their outline was simplified",
    "areas.tunnel_pixels_m2": "area of the workings in pixels of the plan",
    "areas.unconnected_m2": "area of drawn pieces that are not connected to the workings, and are left out",
    "collision.parts": "convex parts of the rock",
    "collision.parts_per_wall_m": "parts for each metre of wall",
    "certificate.holds": "1 if every clause of the certificate holds",
    "certificate.intrusion_*": "rock of the model in the free space",
    "certificate.missing_*": "rock of the plan that the model lacks",
    "certificate.gap_mm": "longest stretch of wall without rock behind it",
    "certificate.rock_round_m": "how far solid rock reaches beyond the workings",
    "certificate.floor_open_m2": "free space without a floor under it",
    "certificate.roof_open_m2": "free space without a roof over it",
    "certificate.clearance_error_m": "largest error of distances to the rock, by MuJoCo",
    "certificate.reached_m2": "floor that a robot of 0.35 m radius reaches from the spawn",
    "certificate.only_world_m2": "floor that it reaches in the world alone",
    "certificate.only_plan_m2": "floor that it reaches in the plan alone",
    "certificate.same_graph": "1 if the reached drifts of world and plan are the same network",
    "certificate.largest_chainage_difference_m": "largest difference of the lengths of such drifts",
    "certificate.deepest_m": "how far a robot was pressed into rock at most",
    "certificate.*": "loops and dead ends of plan and world",
    "texture.published.*": "likeness to the published scan of real rock on one of six axes; 1 is equal",
    "texture.strict.*": "the same, each axis measured as strictly as the data allow",
    "texture.axes_measured.*": "axes of the six that could be measured",
    "texture.draws": "draws of stretches that were measured",
    "texture.spread.*": "spread of the score between draws",
    "texture.measured_*": "the value of the axis itself",
    "texture.flat_walls.*": "the score of flat walls on the same axis: what the score says nothing about",
    "texture.rq_ratio.*": "roughness within windows of this size, over that of the scan",
    "texture.bump_*": "size of bumps, over that of the scan",
    "texture.roof_unevenness_m": "unevenness of the roof",
    "texture.*": "texture of the rock against a scan of real rock",
    "relief.steep_share*": "share of the rock that leans from the wall by more than this angle",
    "relief.flat_face_share": "share of the rock on faces that are nearly flat",
    "relief.spacing_m": "distance of points of the rock where it is finest",
    "relief.cut.*.length_ratio": "length of a level cut through the walls, over that of the plan's wall",
    "relief.cut.*.slope.*": "slope of the spectrum of such a cut between two wavelengths",
    "relief.cut.*.line_rq_m.*": "roughness of such a cut within stretches of this length",
    "relief.*": "shape of the rock",
    "walls.stations": "stations of the survey",
    "walls.measured_share.*": "share of the stations at which it was measured; each wall is a half",
    "walls.interpolated_share.*": "share of the stations at which it lies between measured ones",
    "walls.assumed_share.*": "share of the stations at which nobody measured it",
    "walls.measured_length_share.*": "share of the legs' length with measured ones",
    "walls.interpolated_length_share.*": "share of the legs' length with ones between measured ones",
    "walls.assumed_length_share.*": "share of the legs' length with ones that nobody measured",
    "walls.measured_width_m": "median width of stations at which both walls were measured",
    "walls.splay_m.*": "ends of splays from the built rock, by direction",
    "walls.gap_*": "distance of the visible walls from those that robots feel",
    "walls.at_5_cm.*": "the same 5 cm over the floor",
    "walls.into_workings_share": "share of the visible walls that are inside the felt ones",
    "walls.narrowest_plan_m": "clear width of the narrowest passage of the plan",
    "walls.narrowest_seen_m": "clear width between visible walls there",
    "walls.narrowest_kept": "share of the clear width that the visible rock leaves there",
    "walls.median_kept": "share of the clear width that the visible rock leaves at the median place",
    "scale.*px_per_m*": "pixels of the plan to a metre, by source",
    "scale.*": "scale of the plan, by source",
    "replay.*": "ranges of real sweeps against those in the world",
    "holdout.*": "ranges of sweeps that were held back against those in the world",
    "world.bytes": "size of the bundle, bytes",
    "world.warnings": "warnings of MuJoCo",
    "world.geoms": "shapes of the model",
    "world.lights": "lights of the model",
    "world.floor_zones": "strips of floor with their own friction",
    "world.gain_*": "height that the tilt of the mine adds over this length",
    "world.tilt_deg": "tilt of the mine about the north axis",
    "world.load_*": "time and memory to load the model; they depend on the machine",
    "per_m*.rock_m2": "area of the rock on walls and roof",
    "per_m*": "size, memory and time to load for each unit of the mine",
}


_PARTS = {  # of names of figures
    "overall": "all axes",
    "wall_jaggedness_deg": "jaggedness of the walls, degrees",
    "bump_rq_m": "roughness of bumps, m",
    "roughness_integral_m2": "integral of the roughness, m2",
    "dominant_wavelength_m": "dominant wavelength, m",
    "roof_irregularity_m": "irregularity of the roof, m",
    "wall_heterogeneity_m": "heterogeneity of the walls, m",
}
_SIZES = (
    (re.compile(r"at_(\d+)_cm"), "at {} cm"),
    (re.compile(r"above_(\d+)_deg"), "above {}°"),
    (re.compile(r"from_(\d+)_cm_to_(\d+)_cm"), "from {} to {} cm"),
    (re.compile(r"from_(\d+)_cm_up"), "from {} cm up"),
    (re.compile(r"within_(\d+)cm"), "within {} cm"),
)


def meaning_of(name: str) -> str:
    """Return the sentence about a figure, with its axis or its size; an empty text if there is none."""
    found = next((text for pattern, text in _MEANINGS.items() if fnmatchcase(name, pattern)), "")
    details = [text for part in name.split(".") if (text := _PARTS.get(part) or _size_in(part))]
    return f"{found}: {', '.join(details)}" if found and details else found


def _size_in(part: str) -> str:
    """Return the size that a part of a figure's name states; empty if it states none."""
    for pattern, text in _SIZES:
        if stated := pattern.fullmatch(part):
            return text.format(*stated.groups())
    return ""


def group_of(name: str) -> FigureGroup:
    """Return the group of a figure; its own name is the title of a group that has none."""
    key = name.partition(".")[0]
    return GROUPS.get(key, FigureGroup(key, _METRICS))
