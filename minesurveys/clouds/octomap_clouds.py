"""Points of OctoMap trees (.bt, .ot) by pyoctomap: the middles of occupied voxels.

They come from its nodes: `extractPointCloud` is half a voxel off (findings/octomap-points-half-a-voxel-off.sh).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from minesurveys.clouds.point_blocks import PointBlock, Wanted
from minesurveys.errors import InputError
from minesurveys.limits import FILE, reader_limits
from minesurveys.remarks import warn_user

_BINARY, _FULL = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
_NODE_BYTES = {b"OcTree": 5, b"ColorOcTree": 8, b"OcTreeStamped": 5}  # in a tree that is no binary one
_TERRAIN = b"binterr"
_HEAD_BYTES = 2000
_BLOCK = 200_000


def octomap_blocks(path: Path, _: Wanted) -> Iterator[PointBlock]:
    """Yield the middles of occupied voxels, m, at the tree's own resolution.

    A larger leaf has the voxels on its faces.
    Free and unknown voxels are not used: the free space is found between the points, as in other scans.

    Raises
    ------
    InputError
        If pyoctomap is not installed, or the file is no tree of occupancies, or is broken.
    """
    with path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES)
    if head.startswith(_TERRAIN):
        raise InputError(f"{path}: a terrain (VTP); `gdal_translate {path.name} out.tif` makes a GeoTIFF for --heights")
    if not head.startswith((_BINARY, _FULL)):
        raise InputError(f"{path}: not a tree of OctoMap; its first line would be {_FULL.decode()!r}")
    tree = _tree(path, head)
    resolution, most, count = float(tree.getResolution()), reader_limits().solid_facets, 0
    points: list[np.ndarray] = []
    warn_user(f"an octree of {resolution:g} m; the middles of its occupied voxels are read as a scan", of=path.name)
    for leaf in tree.begin_leafs():
        if not tree.isNodeOccupied(leaf.current_node):
            continue
        side = max(1, round(leaf.getSize() / resolution))
        count += side**3 - max(side - 2, 0) ** 3
        if count > most:
            raise InputError(f"{path}: more than {most:,} occupied voxels, the limit (solid_facets in {FILE})")
        points.append(np.asarray(leaf.getCoordinate(), np.float64) + resolution * _shell(side))
        if len(points) >= _BLOCK:
            yield PointBlock(np.concatenate(points))
            points = []
    if points:
        yield PointBlock(np.concatenate(points))
    elif not count:
        raise InputError(f"{path}: has no occupied voxel; a map with walls is wanted")


def _shell(side: int) -> np.ndarray:
    """Return the middles of the voxels on the faces of a cube of `side` voxels, in voxels from its middle."""
    steps = np.arange(side) - (side - 1) / 2
    if side < 3:
        return np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    face = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    ends = [np.insert(face, axis, end, axis=1) for axis in range(3) for end in steps[[0, -1]]]
    return np.unique(np.concatenate(ends), axis=0)


def _tree(path: Path, head: bytes) -> Any:
    try:
        import pyoctomap
    except ImportError as error:
        raise InputError(f"{path}: OctoMap is read by pyoctomap: pip install 'minexplore-pipeline[octomap]'") from error
    kinds = {
        b"OcTree": pyoctomap.OcTree,
        b"ColorOcTree": pyoctomap.ColorOcTree,
        b"OcTreeStamped": pyoctomap.OcTreeStamped,
    }
    text, mark, _ = head.partition(b"\ndata\n")
    lines = text.splitlines()
    stated = {words[0]: words[1] for words in map(bytes.split, lines) if len(words) == 2}
    named = stated.get(b"id", b"")
    if named not in kinds:
        raise InputError(
            f"{path}: a tree of {named.decode('latin-1')[:40]!r}; want OcTree, ColorOcTree or OcTreeStamped"
        )
    size, held = stated.get(b"size", b""), path.stat().st_size - len(text + mark)
    nodes = int(size) if size.isdigit() and len(size) < 19 else 0
    # Beyond the end of its data the library goes on, and reserves memory without an end.
    fits = 8 * held >= 2 * (nodes - 1) if head.startswith(_BINARY) else held == nodes * _NODE_BYTES[named]
    if not (mark and nodes and fits):
        raise InputError(
            f"{path}: states {size.decode('latin-1')[:20]!r} nodes, which {held:,} bytes do not hold; it is broken, "
            "cut off or empty"
        )
    tree = kinds[named](0.1)
    read = tree.readBinary if head.startswith(_BINARY) else tree.read
    found = read(str(path))
    tree = tree if isinstance(found, bool) or found is None else found
    if not found or nodes != tree.size():
        raise InputError(f"{path}: cannot be read as a tree of OctoMap; it is broken")
    return tree
