"""The splits of the family of generated mines: their sizes, names and seeds, and where a checkout keeps the worlds."""

from __future__ import annotations

import re
from pathlib import Path

SIZES = {"train": 1000, "validation": 50, "test": 200}
STYLES = ("room_and_pillar", "drift_and_crosscut", "ramp", "cave")  # of mine 0, 1, 2, 3, 4, ...: they alternate

# The first seed of each split. Variants of a surveyed mine have a split of their own; nothing is trained in them.
SEEDS = {"train": 0, "validation": 1_000_000, "test": 2_000_000, "variants": 3_000_000}

_NAME = re.compile(r"(train|validation|test)-(\d{4})", re.ASCII)


def mine_name(split: str, number: int) -> str:
    """Return the name of a mine of a split: `test-0007`."""
    return f"{split}-{number:04d}"


def parse_name(name: str) -> tuple[str, int]:
    """Return the split and the number of a mine's name.

    Raises
    ------
    ValueError
        If no split has a mine of this name.
    """
    found = _NAME.fullmatch(name)
    if not found or int(found[2]) >= SIZES[found[1]]:
        ranges = ", ".join(f"{mine_name(split, 0)} to {mine_name(split, size - 1)}" for split, size in SIZES.items())
        raise ValueError(f"mine = {name!r}: want one of {ranges}")
    return found[1], int(found[2])


def light_folder(split: str, number: int) -> Path:
    """Return the folder of a light world below `artifacts/families`."""
    return Path("light") / split / f"{number:04d}"


def world_folder(name: str, families: Path | None = None) -> Path:
    """Return the bundle of a mine by name, in `families` or, by default, in a source checkout.

    Raises
    ------
    ValueError
        If no split has a mine of this name.
    FileNotFoundError
        If the world is not built; the message says how to build it.
    """
    split, number = parse_name(name)
    root = Path(__file__).parents[1] / "artifacts" / "families" if families is None else families
    folder = root / light_folder(split, number) / "realism" / "world"
    if not folder.is_dir():
        command = f"python -m benchmarks worlds --count {number + 1} --split {split}"
        built = f"`{command}` in a source checkout builds it and those before it in artifacts/families"
        raise FileNotFoundError(f"{folder}: mine {name} is not built; {built}")
    return folder
