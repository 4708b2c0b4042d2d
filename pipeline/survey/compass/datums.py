"""EPSG codes of the UTM zones that Compass's projects name."""

from __future__ import annotations

# Datum as Compass writes it -> the first and last zone, south negative, and the code of zone 0.
_ZONES: dict[str, tuple[tuple[int, int, int], ...]] = {
    "ADINDAN": ((35, 38, 20100),),
    "ARC 1950": ((-36, -34, 20900),),
    "ARC 1960": ((-37, -35, 21000),),
    "CAPE": ((-36, -34, 22200),),
    "EUROPEAN 1950": ((28, 38, 23000),),
    "GEODETIC 1949": ((58, 60, 27200),),
    "HU TZU SHAN": ((51, 51, 3778),),
    "INDIAN": ((48, 49, 3100),),
    "NORTH AMERICAN 1927": ((1, 23, 26700), (59, 60, 3311)),
    "NORTH AMERICAN 1983": ((1, 23, 26900), (24, 24, 9688), (59, 60, 3313)),
    "TOKYO": ((51, 55, 3041),),
    "WGS 1972": ((1, 60, 32200), (-60, -1, 32300)),
    "WGS 1984": ((1, 60, 32600), (-60, -1, 32700)),
}


def utm_system(datum: str, zone: int) -> str:
    """Return `EPSG:code` of a datum and a zone, south negative; nothing if there is no code for them."""
    name = " ".join(datum.upper().split())
    for first, last, code in _ZONES.get(name, ()):
        if zone and first <= zone <= last:
            return f"EPSG:{code + abs(zone)}"
    return ""
