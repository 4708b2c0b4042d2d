"""Mines with heights and known answers, as station tables and as worlds in memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.mjcf.assemble import assemble_world
from pipeline.params.config import Config
from pipeline.params.survey import PassageSurveyParams
from pipeline.params.validation import ValidationParams
from pipeline.store.codecs import encode
from pipeline.survey.load import _read
from pipeline.types import Workings
from stages.compile3d import compile_rock
from stages.contours import trace_free_space
from stages.surface import model_surface

HEADER = "leg,station,easting_m,northing_m,left_m,right_m,elevation_m,up_m,down_m\n"
Leg = list[tuple[str, float, float, float]]

# 10 m of 15 % between two level drifts.
RAMP: dict[str, Leg] = {"A": [("a", 0, 0, 100), ("b", 20, 0, 100), ("c", 30, 0, 101.5), ("d", 60, 0, 101.5)]}
# A drift, a ramp from its end, and a drift that the ramp leads to, 9 m under the first.
UNDER: dict[str, Leg] = {
    "A": [("a0", 0, 0, 10), ("a1", 20, 0, 10), ("a2", 40, 0, 10), ("a3", 60, 0, 10)],
    "R": [
        ("a3", 60, 0, 10),
        ("r1", 75, 0, 9),
        ("r2", 88, -10, 7),
        ("r3", 80, -25, 4.8),
        ("r4", 60, -30, 3),
        ("b0", 30, -30, 1),
    ],
    "B": [("b0", 30, -30, 1), ("b1", 30, 0, 1), ("b2", 30, 30, 1)],
}


def spiral(turns: int, radius_m: float = 14.0, grade: float = 0.13) -> dict[str, Leg]:
    """Return a decline that winds round a vertical axis, in twelve legs a turn, with a drift at either end."""
    k = np.arange(12 * turns + 1)
    angle, fall = 2 * np.pi * k / 12, grade * 2 * np.pi * radius_m / 12
    places = np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle), 100 - fall * k])
    places = np.vstack([[radius_m, -25, 100], places, places[-1] + np.array([0, 30, 0])])
    return {"D": [(f"d{i}", float(x), float(y), float(z)) for i, (x, y, z) in enumerate(places)]}


def levels() -> dict[str, Leg]:
    """Return three levels, each with a ring of a drift and a crosscut, ramps between them, and a shaft."""
    legs: dict[str, Leg] = {}
    for number, z in enumerate((0.0, -6.0, -12.0)):
        main = [(f"m{number}{i}", 20.0 * i, 0.0, z) for i in range(4)]
        legs[f"M{number}"] = main
        legs[f"C{number}"] = [main[1], (f"c{number}1", 20, 20, z), (f"c{number}2", 40, 20, z), main[2]]
    for n, z in enumerate((0.0, -6.0)):
        way = [(75, 0, 0.5), (85, -12, 2), (75, -24, 3.2), (62, -24, 4.4), (52, -14, 5.4)]
        ramp = [(f"r{n}{i}", float(x), float(y), z - down) for i, (x, y, down) in enumerate(way)]
        legs[f"R{n}"] = [(f"m{n}3", 60, 0, z), *ramp, (f"m{n + 1}3", 60, 0, z - 6)]
    legs["S"] = [("m00", 0, 0, 0), ("s1", 0.5, 0.5, -3), ("m10", 0, 0, -6)]
    return legs


def table(legs: dict[str, Leg], half_m: float = 2.2) -> str:
    """Return a station table of legs of one width."""
    rows = [
        f"{leg},{name},{x:.4f},{y:.4f},{half_m},{half_m},{z:.4f},3.5,0\n"
        for leg, stations in legs.items()
        for name, x, y, z in stations
    ]
    return HEADER + "".join(rows)


class MineWithHeights:
    """A station table built by stages 1 to 5 in memory; its bundle is written to `folder / "world"`."""

    def __init__(self, legs: dict[str, Leg], config: Config, folder: Path) -> None:
        """Run the functions of the stages."""
        path = folder / "stations.csv"
        path.write_text(table(legs))
        params = PassageSurveyParams(kind="passages", name="heights", file="data/x", heights=None)
        plan, self.survey, polygons = _read(params.model_copy(update={"file": path.as_posix()}))
        traced = trace_free_space(config.contours, plan, self.survey, Workings(polygons))
        self.raw, self.cleaned, self.traced = traced["raw"], traced["cleaned"], traced["traced"]
        self.free_space, self.network = traced["free_space"], traced["topology"]
        rock = compile_rock(config.compile3d, self.free_space, self.network, self.survey)
        self.floor, self.parts = rock["floor"], rock["collision"]
        surface = model_surface(config.surface, self.free_space, self.network, rock["extent"])
        files = assemble_world(
            config.realism,
            self.survey,
            self.free_space,
            self.network,
            rock["extent"],
            rock["collision"],
            rock["floor"],
            rock["spawn"],
            surface["smooth"],
            surface["texture"],
            surface["rough"],
            occupancy=encode(Path("o.npz"), rock["occupancy"]),
            free_space_bt=rock["octree"],
            map_png=encode(Path("map.png"), rock["map"]),
            map_yaml=rock["map_yaml"].encode(),
        )["world"]
        self.bundle = folder / "world"
        for name, data in files.items():
            (self.bundle / name).parent.mkdir(parents=True, exist_ok=True)
            (self.bundle / name).write_bytes(data)

    def stations(self) -> np.ndarray:
        """Return the points (n, 3) m, plan, at which the survey knows the floor."""
        assert self.survey.heights is not None
        return np.concatenate([np.array(line) for line in self.survey.heights.lines])


def certificate_params(config: Config, contacts: int) -> ValidationParams:
    """Return the parameters of stage 6 with a short collision stress test."""
    stress = config.validation.certificate.model_copy(update={"contacts": contacts})
    return config.validation.model_copy(update={"certificate": stress})


__all__ = ["RAMP", "UNDER", "MineWithHeights", "certificate_params", "levels", "spiral", "table"]
