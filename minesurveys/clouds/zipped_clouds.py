"""Zipped point clouds: unpacked one after the other into a temporary file, up to a size, and joined."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath

from minesurveys.clouds.point_blocks import PointBlock
from minesurveys.errors import InputError
from minesurveys.limits import FILE, reader_limits

_PART_BYTES = 1 << 20
_MOST_MEMBERS = 10_000
_NAMED = 5


def zipped_blocks(
    path: Path, suffixes: tuple[str, ...], read: Callable[[Path], Iterator[PointBlock]]
) -> Iterator[PointBlock]:
    """Yield the points of each cloud in a zip file as `read` does; other files in it are not looked at.

    Names in the zip file name no files here.

    Raises
    ------
    InputError
        If it is no zip file, has no cloud, or its clouds are larger than `unpacked_bytes`. Errors of a cloud name it.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            clouds = _clouds(path, archive, suffixes)
            for cloud in clouds:
                with tempfile.TemporaryDirectory() as folder:
                    unpacked = Path(folder) / f"cloud{PurePosixPath(cloud.filename).suffix.lower()}"
                    _unpack(archive, cloud, unpacked)
                    try:
                        yield from read(unpacked)
                    except InputError as error:
                        raise InputError(
                            str(error).replace(str(unpacked), f"{path}: {cloud.filename[:200]}")
                        ) from error
    except (zipfile.BadZipFile, zipfile.LargeZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise InputError(f"{path}: cannot be read as a zip file; it is broken, cut off or encrypted") from error
    except Exception as error:
        if type(error).__module__ in ("zlib", "lzma"):
            raise InputError(f"{path}: cannot be unpacked; it is broken or cut off") from error
        raise


def _clouds(path: Path, archive: zipfile.ZipFile, suffixes: tuple[str, ...]) -> list[zipfile.ZipInfo]:
    members = archive.infolist()
    if len(members) > _MOST_MEMBERS:
        raise InputError(f"{path}: {len(members):,} files in it, at most {_MOST_MEMBERS:,} are looked at")
    names = [PurePosixPath(member.filename) for member in members]
    clouds = [
        member
        for member, name in zip(members, names, strict=True)
        if name.suffix.lower() in suffixes and not name.name.startswith(".") and name.parts[0] != "__MACOSX"
    ]
    if not clouds:
        listed = ", ".join(str(name)[:60] for name in names[:_NAMED]) or "nothing"
        raise InputError(
            f"{path}: no point cloud in it ({', '.join(suffixes)}); it holds {listed}; unpack another survey"
        )
    size, most = sum(member.file_size for member in clouds), reader_limits().unpacked_bytes
    if size > most:
        raise InputError(
            f"{path}: its clouds are {size:,} bytes; the limit is {most:,} (unpacked_bytes in {FILE}); unpack it"
        )
    return clouds


def _unpack(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: Path) -> None:
    """Write a member; it ends where the directory of the file says, whatever its data say."""
    left = member.file_size
    with archive.open(member) as packed, target.open("wb") as out:
        while left and (part := packed.read(min(_PART_BYTES, left))):
            out.write(part)
            left -= len(part)
