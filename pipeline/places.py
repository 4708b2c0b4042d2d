"""The files that the first stage reads and writes."""

from __future__ import annotations

from pathlib import Path

COMPOSED = Path("artifacts/params.json")
CODE_HASHES = Path("artifacts/code.json")  # of each stage, as its manifest has it
ROOT_PARAMS = Path("params.yaml")  # one line of overrides, DVC's only parameter
