"""Maintenance commands: overrides, manifests, the registry, the regression gate."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any


def set_overrides() -> None:
    """Write `$OVERRIDES` to `params.yaml` for `dvc repro`, if they compose. The file is written only if it changes."""
    from pipeline.places import ROOT_PARAMS
    from pipeline.store.files import write_atomically

    overrides = os.environ.get("OVERRIDES", "")
    if overrides:
        _forget_other_params(_composed(overrides))
    text = f"overrides: {json.dumps(overrides)}\n"
    if not ROOT_PARAMS.is_file() or ROOT_PARAMS.read_text() != text:
        write_atomically(ROOT_PARAMS, text.encode())


def _forget_other_params(params: dict[str, Any]) -> None:
    """Remove composed parameters that differ, so that DVC composes again.

    It does not see that the section of one of your mines was edited: `dvc.yaml` names the project's files only.
    """
    from pipeline.places import COMPOSED

    if COMPOSED.is_file() and json.loads(COMPOSED.read_bytes()) != params:
        COMPOSED.unlink()


def _composed(overrides: str) -> dict[str, Any]:
    """Return the parameters with overrides; refused ones leave `params.yaml` as it is."""
    import shlex

    from pipeline.compose import compose
    from pipeline.errors import ParamsError

    try:
        words = shlex.split(overrides)
    except ValueError as error:
        raise ParamsError(f"OVERRIDES = {overrides!r}: {error}") from error
    return compose(words).model_dump(mode="json")


def verify(name: str) -> None:
    """Check the manifests from the survey to a world, the default one or your own, and name the first broken link."""
    from pipeline.places import COMPOSED
    from pipeline.store.verify import verify_chain, verify_world
    from pipeline.worlds import DEFAULT, world_folder

    folder = world_folder(name)
    count = verify_chain(Path(), folder, COMPOSED if name == DEFAULT else folder / "params.yaml")
    print(f"{count} artifacts verified; world {verify_world(folder / 'realism/world')}")


def register(path: Path, origin: str, licence: str) -> None:
    """Add a file below `data/` to `data/registry.txt`."""
    from pipeline.store.registry import register as add

    entry = add(path, origin, licence)
    print(f"data/{entry.name}  {entry.sha256}  {entry.bytes} bytes")


def roughness(sweeps: list[Path], out: Path) -> None:
    """Measure the roughness of walls in planar sweeps and write it as JSON."""
    from pipeline.compose import compose
    from pipeline.metrics.rock.roughness import roughness_of_sweeps
    from pipeline.scans.sweeps import read_sweep
    from pipeline.store.codecs import encode
    from pipeline.store.files import write_report

    gate = compose([]).surface.sweeps
    points = {path.stem: read_sweep(path, gate.max_range_m, gate.max_range_var_m2) for path in sweeps}
    measured = roughness_of_sweeps(points, gate.max_gap_m, gate.window_m, gate.footprint_m)
    write_report(out, encode(out, measured))
    for window, rq, p90 in zip(measured.window_m, measured.rq_m, measured.rq_p90_m, strict=True):
        print(f"{window:4.1f} m: median {1000 * rq:6.1f} mm, 90th percentile {1000 * p90:6.1f} mm")


def clean() -> None:
    """Remove what `make all` wrote. Worlds of your own, exports, training runs and the metrics in git stay."""
    from pipeline.build.world import remove_default_world

    remove_default_world()


def update_baseline() -> None:
    """Accept the present metrics as the baseline of the regression gate."""
    from pipeline.report.baseline import write_baseline

    print(write_baseline())


def update_results() -> None:
    """Write `docs/evidence/results.md` from the present metrics and print it."""
    from pipeline.report.results import write_results

    print(write_results())


def add_to(commands: Any) -> None:
    """Declare the maintenance commands."""
    for function in (set_overrides, clean, update_baseline, update_results):
        name = function.__name__.replace("_", "-")
        commands.add_parser(name, help=function.__doc__).set_defaults(run=lambda a, f=function: f())
    verifier = commands.add_parser("verify", help=verify.__doc__)
    verifier.add_argument("name", nargs="?", default="default", help="of a world that `list` shows")
    verifier.set_defaults(run=lambda a: verify(a.name))
    add = commands.add_parser("register", help=register.__doc__)
    add.add_argument("path", type=Path)
    add.add_argument("--origin", default="unknown")
    add.add_argument("--licence", default="none stated")
    add.set_defaults(run=lambda a: register(a.path, a.origin, a.licence))
    measure = commands.add_parser("roughness", help=roughness.__doc__)
    measure.add_argument("sweeps", type=Path, nargs="+")
    measure.add_argument("--out", type=Path, required=True)
    measure.set_defaults(run=lambda a: roughness(a.sweeps, a.out))
