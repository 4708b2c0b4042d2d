"""The paper's preset beside the default, and what each of its choices costs alone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from tqdm import tqdm

from baselines.base.markdown import markdown_table, write_table
from benchmarks.resume import run_benchmark
from pipeline.compose import compose
from pipeline.errors import MineError
from pipeline.metrics.rock.paper import PAPER
from pipeline.params.reading.composed import root_overrides
from pipeline.report.results import read_metrics
from pipeline.store.files import write_atomically
from pipeline.store.hashing import sha256_bytes
from pipeline.store.manifest import code_sha256
from pipeline.store.registry import REGISTRY
from stages.__main__ import STAGES

RUNS = Path("artifacts/benchmarks/paper")
TABLE = Path("docs/evidence/parts/compare-paper.md")
_PAPER = "preset=paper"
# One choice of the preset at a time.
_CHOICES = {
    "default": [],
    "948 px frame at 1.36 px/m": ["survey", "contours.bridge_m", "contours.despeck_m"],
    "simplification 0.55 m": ["contours.tolerance_m"],
    "V-HACD, 70 tiles, 32 hulls": ["compile3d"],
    "33 lights": ["realism"],
    "the paper's preset": ["survey", "contours", "compile3d", "realism"],
}
_COLUMNS = {
    "IoU": ("iou.free_space_vs_cleaned", ".4f"),
    "hulls": ("collision.parts", "d"),
    "tunnel, m2": ("areas.tunnel_m2", ",.0f"),
    "island, m2": ("areas.islands_m2", ",.0f"),
    "intrusion, m2": ("certificate.intrusion_m2", ",.2f"),
    "missing, m2": ("certificate.missing_m2", ",.2f"),
    "blocked columns": ("navigability.blocked", ",d"),
    "drifts lost": ("topology.drifts_lost", "d"),
    "lights": ("world.lights", "d"),
    "load, s": ("world.load_s", ".3f"),
}


def overrides_for(keys: list[str]) -> dict:
    """Return the default configuration with the named parts taken from the paper's preset."""
    default, paper = (compose([*root_overrides(), *extra]).model_dump(mode="json") for extra in ([], [_PAPER]))
    for key in keys:
        *groups, last = key.split(".")
        target, source = default, paper
        for group in groups:
            target, source = target[group], source[group]
        target[last] = source[last]
    default["validation"]["limits"] = {}  # reported, not judged
    return default


def run_pipeline(folder: Path, config: dict) -> dict[str, float]:
    """Run the six stages in a folder of their own and return the flat metrics; finished runs are not repeated."""
    params = json.dumps(config)
    code = [code_sha256(stage, Path.cwd()) for stage in STAGES]
    key = sha256_bytes("".join([params, REGISTRY.read_text(), *code]).encode())
    stamp = folder / "done"
    if not (stamp.is_file() and stamp.read_text() == key):
        write_atomically(folder / "artifacts/params.json", params.encode())
        for name in ("conf", "data", "minexplore", "pipeline", "stages"):
            link = folder / name
            if not link.exists():
                link.symlink_to(Path(os.path.relpath(name, folder)))
        for stage in STAGES:
            command = [sys.executable, "-m", f"stages.{stage}"]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
            if done.returncode:
                raise MineError(f"{folder}: {done.stderr.strip()}")
        write_atomically(stamp, key.encode())
    return read_metrics(folder / "artifacts" / "validation")


def _stated(name: str, form: str) -> str:
    value = PAPER.get(name, "-")
    return value if isinstance(value, str) else format(value, form)


def main() -> int:
    """Run each choice, print the table and write it to `docs/`."""
    rows = []
    for title, keys in tqdm(_CHOICES.items(), unit="world", disable=not sys.stderr.isatty()):
        folder = RUNS / "".join(c if c.isalnum() else "_" for c in title)
        metrics = run_pipeline(folder, overrides_for(keys))
        rows.append((title, *(format(metrics[n], f) for n, f in _COLUMNS.values())))
    stated = (_stated(name, form) for name, form in _COLUMNS.values())
    text = markdown_table(["", *_COLUMNS], [*rows, ("*paper, as printed*", *stated)])
    write_table(TABLE, text)
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("compare-paper", main))
