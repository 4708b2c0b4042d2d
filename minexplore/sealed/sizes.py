"""How large each file of a bundle may be. The limits follow from the counts that the tables allow a builder."""

from __future__ import annotations

from minexplore.bundle import (
    CELLS,
    CLEARANCE_GRID,
    FREE_SPACE,
    MADE_BY,
    MODEL,
    NAV2_PICTURE,
    OCTREE,
    PARTS,
    PREVIEW,
    RECORD,
    ROCK_TEXTURE,
    TOPOLOGY,
    VOLUME,
    BundleError,
)

MOST_FACETS, MOST_SPANS = 5_000_000, 5_000_000  # of a volume: 100 km of drifts 3 m wide, in cells of 0.25 m
MOST_COLUMNS = 100_000_000  # of its box in plan: 2,500 m square at 0.25 m
MOST_CORNERS = 16  # of a part, on average; those of caves have 7, and one may have more
MOST_VOLUME_PARTS = 1_000_000  # of a narrow cave of 33 km; names have numbers of six digits
MOST_BUNDLE_BYTES, MOST_FILES = 1 << 30, 100_000
MOST_TILE_PIXELS = 1 << 20  # of a height field; all of them may have as many as the grid has cells
MOST_ZONES = 1000
MOST_CELLS = 100_000_000  # of the clearance grid: 2,500 m square at 0.25 m
MOST_PIXELS = {PREVIEW: 4096 * 16_384, NAV2_PICTURE: MOST_CELLS, ROCK_TEXTURE: 4096 * 4096}
_UNPACKED = 1.001, 65_536  # deflate stores what it cannot pack: so much more, and headers
_TEXT = 64 << 20  # 100,000 files of 600 bytes; 2.5 million corners or stations
_PART_TEXT = 500  # bytes of a part's mesh and geom in mine.xml, on average; those of caves have 390


def _packed(unpacked: int) -> int:
    share, headers = _UNPACKED
    return int(unpacked * share) + headers


_MOST_BYTES = {
    RECORD: _TEXT,
    MODEL: MOST_VOLUME_PARTS * _PART_TEXT,
    FREE_SPACE: _TEXT,
    TOPOLOGY: _TEXT,
    MADE_BY: 16_384,  # thirty fields, ten of each kind of furniture
    OCTREE: 256 << 20,  # 2 bytes an inner node: 130 million nodes
    CLEARANCE_GRID: _packed(5 * MOST_CELLS),
    VOLUME: _packed(MOST_FACETS * (8 * 3 + 4 * 5)),
    PARTS: _packed(MOST_VOLUME_PARTS * (8 * 3 * MOST_CORNERS + 8)),
    CELLS: _packed(MOST_SPANS * (8 * 3 + 4 * 3)),
    PREVIEW: _packed(3 * MOST_PIXELS[PREVIEW]),
    ROCK_TEXTURE: _packed(3 * MOST_PIXELS[ROCK_TEXTURE]),
}
_OF_SUFFIX = {
    ".yaml": 1000,  # seven lines
    ".png": _packed(MOST_CELLS),  # maps
    ".msh": 256 << 20,  # 3.5 million faces; a smooth surface has one mesh a piece, a rough one many
}


def most_bytes(name: str) -> int:
    """Return how many bytes a bundle's file of this name may have."""
    return _MOST_BYTES.get(name) or _OF_SUFFIX[name[name.rindex(".") :]]


def require_size(name: str, size: int) -> None:
    """Refuse a file that is larger than a builder writes it.

    Raises
    ------
    BundleError
        Naming the file, its size and the limit.
    """
    if size > most_bytes(name):
        raise BundleError(f"{name}: {size} bytes, at most {most_bytes(name)} in a world")
