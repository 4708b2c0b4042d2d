"""Labels on disk: one file of plain arrays for each mine of each round, so that an ended run goes on after the last."""

from __future__ import annotations

import zipfile
from dataclasses import fields
from pathlib import Path

import numpy as np

from baselines.errors import BaselineError
from baselines.graph.expert import Labels


def write_labels(path: Path, labels: Labels) -> None:
    """Write labels beside the file's place, then move them there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        np.savez_compressed(file, **{field.name: getattr(labels, field.name) for field in fields(Labels)})
    part.rename(path)


def read_labels(paths: list[Path]) -> Labels:
    """Return the labels of some files together.

    Raises
    ------
    BaselineError
        If one holds no labels.
    """
    parts: dict[str, list[np.ndarray]] = {field.name: [] for field in fields(Labels)}
    for path in paths:
        try:
            with np.load(path, allow_pickle=False) as file:
                for name, arrays in parts.items():
                    arrays.append(file[name])
        except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
            raise BaselineError(f"{path}: not a file of labels ({error}); remove it") from error
    return Labels(**{name: np.concatenate(arrays) for name, arrays in parts.items()})
