"""The files of the composed configuration and of its overrides."""

from __future__ import annotations

from pathlib import Path

COMPOSED = Path("artifacts/params.yaml")
ROOT_PARAMS = Path("params.yaml")  # one line of overrides, DVC's only parameter
