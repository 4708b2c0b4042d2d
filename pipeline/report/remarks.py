"""What was guessed, dropped or assumed for a world: remarks of the detection of its file, and of its stages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from minesurveys.remarks import Remark, collect_remarks, hand_on
from pipeline.store.codecs import decode, encode
from pipeline.store.files import write_atomically
from pipeline.store.hashing import sha256_bytes
from pipeline.store.manifest import Manifest

DETECTED = "detected.json"  # in a world's folder: the remarks of the detection, which no manifest has


def write_detected(root: Path, remarks: Sequence[Remark]) -> dict[Path, str]:
    """Write the remarks of the detection of a world's file; return the file with its sha256."""
    data = encode(root / DETECTED, [asdict(remark) for remark in remarks])
    write_atomically(root / DETECTED, data)
    return {root / DETECTED: sha256_bytes(data)}


def read_detected(root: Path) -> list[Remark]:
    """Return the remarks of the detection of a world's file; none of a world that no detection made."""
    found: list[Remark] = decode(root / DETECTED, list[Remark]) if (root / DETECTED).is_file() else []
    return found


def remarks_of(root: Path, manifests: Sequence[Manifest], source: str) -> list[Remark]:
    """Return all remarks of a world, each with its count and its option apart; `source` is the name of its file."""
    with collect_remarks() as found:
        hand_on(read_detected(root))
        for manifest in manifests:
            hand_on(manifest.remarks)
    return [remark.named_in(source) for remark in found]
