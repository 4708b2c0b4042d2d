"""The formats that worlds are written in, each with its writer and its own loader."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from pipeline.errors import InputError
from pipeline.export.formats.gltf import write_gltf
from pipeline.export.formats.gltf_reader import read_gltf
from pipeline.export.formats.obj import read_obj, write_obj
from pipeline.export.formats.sdf import write_sdf
from pipeline.export.formats.sdf_reader import read_sdf
from pipeline.export.formats.usd import write_usd
from pipeline.export.formats.usd_reader import read_usd
from pipeline.export.scene import ExportScene, Files, ReadScene, WorldFacts


@dataclass(frozen=True)
class ExportFormat:
    """A writer, a reader, and the package whose loader reads; `module` is what that package is imported by."""

    write: Callable[[ExportScene], Files]
    read: Callable[[Path, WorldFacts], ReadScene]
    package: str
    module: str

    @property
    def loader(self) -> str:
        """Return the loader's package with its version."""
        try:
            return f"{self.package} {version(self.package)}"
        except PackageNotFoundError:
            return self.package


FORMATS = {
    "usd": ExportFormat(write_usd, read_usd, "usd-core", "pxr"),
    "sdf": ExportFormat(write_sdf, read_sdf, "trimesh", "trimesh"),
    "gltf": ExportFormat(write_gltf, read_gltf, "trimesh", "trimesh"),
    "obj": ExportFormat(write_obj, read_obj, "trimesh", "trimesh"),
}


def require_format(name: str) -> ExportFormat:
    """Return a format by name.

    Raises
    ------
    InputError
        If the package that reads it is not installed.
    """
    found = FORMATS[name]
    if find_spec(found.module) is None:
        raise InputError(f"--to {name}: {found.package} is not installed; the extra `export` of this package has it")
    return found
