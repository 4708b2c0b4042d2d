"""The regression gate: IoU and texture scores against the accepted baseline."""

from __future__ import annotations

import json
from pathlib import Path

from pipeline.report.results import read_metrics
from pipeline.store.files import write_atomically

BASELINE = Path("tests/baseline.json")
_GATED = ("iou.", "texture.published.", "texture.strict.")


def gated(metrics: dict[str, float]) -> dict[str, float]:
    """Return the metrics that the gate compares: IoU and texture scores."""
    return {k: v for k, v in metrics.items() if k.startswith(_GATED)}


def write_baseline() -> str:
    """Write the current gated metrics to the baseline and return the changes, one per line."""
    now = gated(read_metrics())
    before = json.loads(BASELINE.read_text()) if BASELINE.is_file() else {}
    write_atomically(BASELINE, (json.dumps(now, indent=2) + "\n").encode())
    return "\n".join(f"{name}: {before.get(name, '-')} -> {value}" for name, value in now.items())
