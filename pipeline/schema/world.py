"""Check a whole bundle but its model: what `minexplore` checks of it, then the record and the files."""

from __future__ import annotations

from pathlib import Path

from minexplore.bundle import RECORD, BundleError, has_visible_rock
from minexplore.sealed.files import read_folder
from minexplore.sealed.world import SealedWorld, hash_files, open_files
from pipeline.schema.files import check_contents
from pipeline.schema.record import check_record
from pipeline.schema.volume.arrays import check_arrays
from pipeline.schema.volume.files import check_rock, check_volume_files, require_volume_files
from pipeline.schema.volume.record import check_figures, check_volume_record


def check_world(folder: Path) -> SealedWorld:
    """Read a bundle once, and refuse it unless the tables allow all of it.

    Raises
    ------
    BundleError
        Naming the folder's file, the place in it, the value and what is wanted.
    """
    files = read_folder(folder)
    return check_tables(folder, open_files(folder, files, hash_files(files)))


def check_tables(folder: Path, world: SealedWorld) -> SealedWorld:
    """Return a bundle that was opened, if the tables allow all of it; see `check_world`. Nothing is read again."""
    try:
        (_check_level if world.volume is None else _check_volume)(world)
    except BundleError as error:
        raise BundleError(f"{folder}/{error}") from error
    return world


def _check_level(world: SealedWorld) -> None:
    record, files = world.record, world.files
    check_record(RECORD, record)
    check_contents(record, files, world.grid)


def _check_volume(world: SealedWorld) -> None:
    record, files, volume = world.record, world.files, world.volume
    assert volume is not None
    check_volume_record(record)
    require_volume_files(record, files)
    check_arrays(volume)
    check_figures(record, volume)
    check_volume_files(record, files, volume)
    if has_visible_rock(record):
        check_rock(files, volume)
