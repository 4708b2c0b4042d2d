"""The committed list of the family's worlds: split, seed, style and hash of each mine that is listed."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from minexplore.splits import SEEDS, SIZES
from pipeline.errors import InputError
from pipeline.store.files import write_atomically
from pipeline.store.locks import hold_lock

LIST = Path("data/families/splits.csv")
_NOTE = (
    "# Light worlds of the splits, made by `python -m benchmarks splits`. A hash holds for the package "
    "versions of requirements/ and\n"
    "# this version of the pipeline.\n"
)
_SHA256 = re.compile("[0-9a-f]{64}")


@dataclass(frozen=True)
class Listed:
    """One line of the list."""

    split: str
    seed: int
    style: str
    world_sha256: str


def read_list(file: Path = LIST) -> dict[tuple[str, int], Listed]:
    """Return the listed worlds by split and seed; none if there is no list.

    Raises
    ------
    InputError
        Naming the line that is not a world of a split.
    """
    if not file.is_file():
        return {}
    lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    listed: dict[tuple[str, int], Listed] = {}
    for number, row in enumerate(csv.DictReader(lines), start=1):
        try:
            world = Listed(str(row["split"]), int(row["seed"]), str(row["style"]), str(row["world_sha256"]))
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(f"{file}: world {number}: {error}") from error
        first = SEEDS.get(world.split, -1)
        if not (world.split in SIZES and first <= world.seed < first + SIZES[world.split]):
            raise InputError(f"{file}: world {number}: no split {world.split!r} has the seed {world.seed}")
        if not _SHA256.fullmatch(world.world_sha256) or (world.split, world.seed) in listed:
            raise InputError(
                f"{file}: world {number}: {world.world_sha256!r:.80} is no hash, or the world stands twice"
            )
        listed[world.split, world.seed] = world
    return listed


def write_list(worlds: Iterable[Listed], file: Path = LIST) -> None:
    """Write worlds to the list; those that it holds already are replaced, others stay."""
    with hold_lock(file.with_name(f".{file.name}.lock"), None):
        _write(read_list(file), worlds, file)


def _write(kept: dict[tuple[str, int], Listed], worlds: Iterable[Listed], file: Path) -> None:
    merged = kept | {(world.split, world.seed): world for world in worlds}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(Listed))
    writer.writerows(astuple(merged[key]) for key in sorted(merged, key=lambda key: key[1]))
    write_atomically(file, (_NOTE + text.getvalue()).encode())
