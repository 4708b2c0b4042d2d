"""The arrays of a world that is one volume: their sizes, shapes and ranges."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from minexplore.bundle import CELLS, PARTS, VOLUME, BundleError
from minexplore.floors.volume_arrays import WAYS, FacetLabel, FloorSpans, Parts, VolumeArrays, VolumeFacets
from minexplore.sealed.arrays import read_arrays
from minexplore.sealed.sizes import MOST_COLUMNS, MOST_CORNERS, MOST_FACETS, MOST_SPANS, MOST_VOLUME_PARTS

MOST_OF_PART = 4096  # corners
REACH_M = 1e5  # of any coordinate: 32 bits of a ray then have a centimetre

_FACETS = {"vertices": ("<f8", 2), "faces": ("<i4", 2), "label": ("<i4", 1), "leg": ("<i4", 1)}
_PARTS = {"corners": ("<f8", 2), "first": ("<i4", 1), "label": ("<i4", 1)}
_SPANS = {
    "column": ("<i4", 1),
    "row": ("<i4", 1),
    "floor_m": ("<f8", 1),
    "headroom_m": ("<f8", 1),
    "clearance_m": ("<f8", 1),
    "storey": ("<i4", 1),
    "aside_m": ("<f4", 2),
    "way_m": ("<f4", 2),
    "origin_m": ("<f8", 1),
    "cell_m": ("<f8", 0),
}
_MEASURED = ("floor_m", "headroom_m", "clearance_m", "aside_m", "way_m")
_BESIDE_M = 1.0  # parts of 0.3 m reach so far beyond the free space, where its walls turn
_MOST_FLOORS = 1000  # in one column
_OFF_FLOOR_M = 1e-3  # spans have six decimals
_MORE, _SOME = 2, 1000  # times that the floors may have the cells of the spans, and cells besides: of edges


def read_volume(files: Mapping[str, bytes]) -> VolumeArrays:
    """Return the arrays of a volume's files.

    Raises
    ------
    BundleError
        Naming the file, the array, and what is wrong with it.
    """
    for name in (VOLUME, PARTS, CELLS):
        if name not in files:
            raise BundleError(f"{name}: missing")
    facets = _read_facets(files[VOLUME])
    return VolumeArrays(facets, _read_parts(files[PARTS], facets), _read_spans(files[CELLS], facets))


def _read_facets(data: bytes) -> VolumeFacets:
    arrays = read_arrays(VOLUME, data, _FACETS, 3 * MOST_FACETS)
    vertices, faces, label, leg = (arrays[name] for name in _FACETS)
    if vertices.shape[1] != 3 or faces.shape[1] != 3 or len(faces) < 4 or len({len(faces), len(label), len(leg)}) > 1:
        shapes = {name: array.shape for name, array in arrays.items()}
        raise BundleError(f"{VOLUME}: shapes {shapes}, want (n, 3), (f, 3), (f,) and (f,) of four facets or more")
    _require_within(VOLUME, "vertices", vertices, REACH_M)
    _require_range(VOLUME, "faces", faces, 0, len(vertices) - 1)
    _require_range(VOLUME, "label", label, 0, len(FacetLabel) - 1)
    _require_range(VOLUME, "leg", leg, 0, 10_000_000)
    if not (label == FacetLabel.FLOOR).any():
        raise BundleError(f"{VOLUME}: label: no facet is a floor")
    return VolumeFacets(vertices, faces, label, leg)


def _read_parts(data: bytes, facets: VolumeFacets) -> Parts:
    arrays = read_arrays(PARTS, data, _PARTS, 3 * MOST_CORNERS * MOST_VOLUME_PARTS)
    corners, first, label = (arrays[name] for name in _PARTS)
    if corners.shape[1] != 3 or len(first) != len(label) + 1 or not 1 <= len(label) <= MOST_VOLUME_PARTS:
        raise BundleError(
            f"{PARTS}: shapes {corners.shape}, {first.shape} and {label.shape}, want (c, 3), (p + 1,) and (p,) of 1 to "
            f"{MOST_VOLUME_PARTS} parts"
        )
    _require_range(PARTS, "label", label, 0, len(FacetLabel) - 1)
    count = np.diff(first.astype(np.int64))
    if first[0] != 0 or first[-1] != len(corners) or count.min() < 4 or count.max() > MOST_OF_PART:
        raise BundleError(f"{PARTS}: first: want numbers from 0 to {len(corners)}, 4 to {MOST_OF_PART} apart")
    parts = Parts(corners, first, label)
    low, high = facets.vertices.min(axis=0) - _BESIDE_M, facets.vertices.max(axis=0) + _BESIDE_M
    outside = np.flatnonzero(~((corners >= low) & (corners <= high)).all(axis=1))
    if len(outside):
        number = int(np.searchsorted(first, outside[0], side="right")) - 1
        place = corners[outside[0]].tolist()
        raise BundleError(f"{PARTS}: part {number} has a corner at {place}, want finite numbers near the free space")
    return parts


def _read_spans(data: bytes, facets: VolumeFacets) -> FloorSpans:
    arrays = read_arrays(CELLS, data, _SPANS, len(WAYS) * MOST_SPANS)
    numbers = [arrays[name] for name in _SPANS if name not in ("origin_m", "cell_m")]
    if len({len(column) for column in numbers}) > 1 or not len(numbers[0]) or arrays["origin_m"].shape != (2,):
        raise BundleError(f"{CELLS}: want one or more spans, of which all arrays have as many, and origin_m of two")
    if len(numbers[0]) > MOST_SPANS:
        raise BundleError(f"{CELLS}: {len(numbers[0])} spans, want at most {MOST_SPANS}")
    if arrays["aside_m"].shape[1] != 3 or arrays["way_m"].shape[1] != len(WAYS):
        raise BundleError(f"{CELLS}: want aside_m of three columns and way_m of {len(WAYS)}")
    cell, origin = float(arrays["cell_m"]), arrays["origin_m"]
    low, high = facets.vertices.min(axis=0), facets.vertices.max(axis=0)
    if not 0.05 <= cell <= 2:
        raise BundleError(f"{CELLS}: cell_m = {cell}, want 0.05 to 2")
    if not ((origin <= low[:2]) & (origin >= low[:2] - 10)).all():
        raise BundleError(
            f"{CELLS}: origin_m = {origin.tolist()}, want at most 10 m west and south of {low[:2].tolist()}"
        )
    most = np.ceil((high[:2] - origin) / cell)
    _require_range(CELLS, "column", arrays["column"], 0, int(most[0]))
    _require_range(CELLS, "row", arrays["row"], 0, int(most[1]))
    if most[0] * most[1] > MOST_COLUMNS:
        raise BundleError(f"{CELLS}: {most[0]:.0f} x {most[1]:.0f} columns, want at most {MOST_COLUMNS}")
    floors_m2 = -float(np.minimum(facets.normals[:, 2], 0).sum()) / 2  # seen from above
    if floors_m2 / cell**2 > _MORE * len(numbers[0]) + _SOME:
        raise BundleError(
            f"{CELLS}: cell_m = {cell} and {len(numbers[0])} spans: the mesh has floors of {floors_m2:.0f} m2, which "
            f"are {floors_m2 / cell**2:.0f} cells"
        )
    _require_range(CELLS, "storey", arrays["storey"], -1, len(numbers[0]) - 1)
    floor, headroom = arrays["floor_m"], arrays["headroom_m"]
    bad = ~((floor >= low[2] - _OFF_FLOOR_M) & (headroom > 0) & (floor + headroom <= high[2] + _OFF_FLOOR_M))
    bad |= ~((arrays["clearance_m"] >= 0) & (arrays["clearance_m"] < np.inf))
    bad |= ~(np.abs(arrays["aside_m"]) <= cell).all(axis=1)
    bad |= ~((arrays["way_m"] >= 0) & (arrays["way_m"] < np.inf)).all(axis=1)
    if bad.any():
        k = int(bad.argmax())
        found = ", ".join(f"{name} = {arrays[name][k].tolist()}" for name in _MEASURED)
        raise BundleError(
            f"{CELLS}: span {k}: {found}: want finite numbers, floor and roof within the free space, places of the cell"
        )
    _require_apart(arrays)
    return FloorSpans(*(arrays[name] for name in _SPANS if name != "cell_m"), cell)  # type: ignore[call-arg, arg-type]


def _require_apart(arrays: dict[str, np.ndarray]) -> None:
    """Refuse floors of one column that are not over each other's roofs, or more than `_MOST_FLOORS` of them."""
    column, row, floor = (arrays[name] for name in ("column", "row", "floor_m"))
    order = np.lexsort([floor, row, column])
    same = (np.diff(column[order]) == 0) & (np.diff(row[order]) == 0)
    roof = (floor + arrays["headroom_m"])[order]
    bad = np.flatnonzero(same & (floor[order][1:] < roof[:-1] - _OFF_FLOOR_M))
    if len(bad):
        one, other = order[bad[0] : bad[0] + 2]
        raise BundleError(f"{CELLS}: spans {one} and {other} are in one column and overlap")
    starts = np.append(np.flatnonzero(np.append(True, ~same)), len(order))
    most = int(np.diff(starts).max())
    if most > _MOST_FLOORS:
        raise BundleError(f"{CELLS}: {most} floors over each other in one column, want at most {_MOST_FLOORS}")


def _require_within(file: str, name: str, values: np.ndarray, most: float) -> None:
    if not (np.abs(values) <= most).all():
        raise BundleError(f"{file}: {name}: want finite numbers up to {most:g} m")


def _require_range(file: str, name: str, values: np.ndarray, low: int, high: int) -> None:
    bad = (values < low) | (values > high)
    if bad.any():
        k = tuple(int(i[0]) for i in np.nonzero(bad))
        raise BundleError(f"{file}: {name}{list(k)} = {values[k]}: want {low} to {high}")
