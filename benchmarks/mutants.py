"""Test the validator: inject faults into a good world one by one, and check that each is found."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from pathlib import Path

from tqdm import tqdm

from benchmarks.fault_injection import edit_model, seal
from benchmarks.faults import Mutant, faults
from pipeline.compose import composed_section
from pipeline.errors import MineError
from pipeline.metrics.limits import breaches
from pipeline.params.validation import CertificateParams, Limit, ValidationParams
from pipeline.proof.validator import Validator
from pipeline.store.codecs import decode
from pipeline.store.files import write_atomically
from pipeline.store.verify import verify_chain
from pipeline.types import Mask, Survey

ARTIFACTS = Path("artifacts")
# Stage 6 empties artifacts/validation, so a second copy is kept.
TABLES = [ARTIFACTS / folder / "mutants.json" for folder in ("validation", "proof")]


def examine(mutant: Mutant, good: Path, params: ValidationParams, plan: tuple[Mask, Mask, Survey]) -> dict:
    """Inject one fault into a copy of a bundle and return which check found it."""
    row = {
        "fault": mutant.name,
        "expected": mutant.expected or f"refused: {mutant.refused}",
        "found": "",
        "caught": False,
    }
    with tempfile.TemporaryDirectory() as folder:
        bundle = Path(folder) / "world"
        shutil.copytree(good, bundle)
        mutant.inject(bundle)
        if mutant.expected:
            seal(bundle)
        try:
            group, _, figure = mutant.expected.partition(".")
            validator = Validator(params, bundle, *plan)
            if mutant.refused:
                return row | {"found": "accepted"}
            metrics = {group: validator.measure(group)}
            if group == "certificate":
                clauses = {
                    k: v for k, v in validator.certificate.clauses.items() if not v.holds and v.value is not None
                }
                failed = ", ".join(f"{k} = {v.value}" for k, v in clauses.items())
                row |= {"found": failed, "caught": figure in clauses}
            else:
                lines = breaches(metrics, _limits_of_groups(params, (group,)))
                row |= {
                    "found": "; ".join(lines),
                    "caught": any(line.startswith(f"{mutant.expected} = ") for line in lines),
                }
        except MineError as error:
            row |= {"found": str(error), "caught": bool(mutant.refused) and mutant.refused in str(error)}
    return row


def _limits_of_groups(params: ValidationParams, groups: tuple[str, ...]) -> dict[str, Limit]:
    """Return the limits on some groups of metrics, without the load time, which depends on the machine."""
    return {k: v for k, v in params.limits.items() if k.partition(".")[0] in groups and not k.startswith("world.load")}


def control_failures(good: Path, params: ValidationParams, plan: tuple[Mask, Mask, Survey]) -> list[str]:
    """Return the limits that a copy without a fault breaches after it is read, written and sealed again."""
    with tempfile.TemporaryDirectory() as folder:
        bundle = Path(folder) / "world"
        shutil.copytree(good, bundle)
        edit_model(lambda spec: None)(bundle)
        seal(bundle)
        validator = Validator(params, bundle, *plan)
        groups = ("iou", "navigability", "topology", "certificate", "texture", "walls", "world")
        limits = _limits_of_groups(params, groups)
        return breaches({group: validator.measure(group) for group in groups}, limits)


def break_chain(root: Path) -> dict:
    """Change a hash in the chain of manifests and return whether the check names the broken link."""
    row = {"fault": "hash chain broken", "expected": "refused: what contours read", "found": "", "caught": False}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("artifacts", "conf", "data", "pipeline", "stages", "minexplore", "dvc.yaml", "params.yaml"):
            (Path(folder) / name).symlink_to((root / name).resolve())
        (Path(folder) / "artifacts").unlink()
        shutil.copytree(root / "artifacts", Path(folder) / "artifacts", ignore=shutil.ignore_patterns("bench*"))
        path = Path(folder) / "artifacts/contours/manifest.json"
        manifest = json.loads(path.read_text())
        name = next(iter(manifest["inputs"]))
        manifest["inputs"][name] = "0" * 64
        path.write_text(json.dumps(manifest))
        try:
            verify_chain(Path(folder))
        except MineError as error:
            row |= {"found": str(error), "caught": "what contours read" in str(error)}
    return row


def _print_row(row: dict) -> None:
    """Print the result of one fault."""
    tqdm.write(f"{'caught' if row['caught'] else 'MISSED'}  {row['fault']}: {row['found'][:110]}", file=sys.stdout)
    sys.stdout.flush()


def main() -> int:
    """Inject every fault into the present world; exit code 1 if the expected check misses one."""
    try:
        plan = (
            decode(ARTIFACTS / "contours/cleaned.png", Mask),
            decode(ARTIFACTS / "contours/raw.png", Mask),
            decode(ARTIFACTS / "survey/survey.json", Survey),
        )
        params = composed_section("validation")
        params = params.model_copy(update={"certificate": _without_stress(params.certificate)})
        good = ARTIFACTS / "realism/world"
        control = control_failures(good, params, plan)
        if control:
            raise MineError(f"the world without a fault fails: {'; '.join(control)}")
        rows = []
        for mutant in tqdm(faults(good), desc="mutants", disable=None):
            rows.append(examine(mutant, good, params, plan))
            _print_row(rows[-1])
        rows.append(break_chain(Path()))
        _print_row(rows[-1])
    except MineError as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2
    caught = sum(row["caught"] for row in rows)
    report = {"total": len(rows), "caught": caught, "rows": rows}
    for table in TABLES:
        write_atomically(table, (json.dumps(report, indent=2) + "\n").encode())
    print(f"{caught} of {len(rows)} caught")
    return 0 if caught == len(rows) else 1


def _without_stress(params: CertificateParams) -> CertificateParams:
    limits = {k: v for k, v in params.limits.items() if k not in ("contacts", "escapes", "deepest_m")}
    return params.model_copy(update={"contacts": 0, "limits": limits})


if __name__ == "__main__":
    sys.exit(main())
