"""Test the validator: put faults of a list and random changes into good worlds, and check that each is found.

A listed fault that a figure measures must be found twice: by that figure, with the tables and comparisons of the whole
world switched off, and by these. All others must be found by these. `--random N` sets the number of random mutants of a
small world.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path

from tqdm import tqdm

from benchmarks.faults.injection import edit_model, seal
from benchmarks.faults.judge import CRASHED, MISSED, judge_many, prove, summarise
from benchmarks.faults.listed import Mutant, faults
from benchmarks.results import run_benchmark
from pieces.work import add_options, where_of
from pipeline.errors import MineError
from pipeline.metrics.limits import breaches
from pipeline.params.composed import composed_section
from pipeline.params.validation import CertificateParams, Limit, ValidationParams
from pipeline.proof.validator import Validator
from pipeline.store.codecs import decode
from pipeline.store.files import write_atomically
from pipeline.store.mine_survey import open_survey
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
        "refused": "",
        "caught": False,
    }
    with tempfile.TemporaryDirectory() as folder:
        bundle = Path(folder) / "world"
        shutil.copytree(good, bundle)
        mutant.inject(bundle)
        if mutant.sealed:
            seal(bundle)
        row |= {"refused": _refusal(bundle, params, mutant.refused)}
        if mutant.refused:
            return row | {"found": row["refused"], "caught": bool(row["refused"])}
        try:
            group, _, figure = mutant.expected.partition(".")
            validator = Validator(params, bundle, *plan, checked=False)
            metrics = {group: validator.measure(group)}
            if group == "certificate":
                clauses = {
                    k: v for k, v in validator.certificate.clauses.items() if not v.holds and v.value is not None
                }
                failed = ", ".join(f"{k} = {v.value}" for k, v in clauses.items())
                row |= {"found": failed, "caught": figure in clauses and bool(row["refused"])}
            else:
                lines = breaches(metrics, _limits_of_groups(params, (group,)))
                row |= {
                    "found": "; ".join(lines),
                    # How rough rock is, is a parameter: only stage 6 has limits on it.
                    "caught": any(line.startswith(f"{mutant.expected} = ") for line in lines)
                    and bool(row["refused"] or group == "texture"),
                }
        except MineError as error:
            row |= {"found": str(error)}
    return row


def _refusal(bundle: Path, params: ValidationParams, words: str) -> str:
    """Return the error with which a bundle is refused as a whole, or nothing if it is accepted or lacks the words."""
    try:
        prove(bundle, params)
    except MineError as error:
        return str(error).replace(str(bundle), "world") if words in str(error) else ""
    return ""


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
    row = {"fault": "hash chain broken", "expected": "refused: in the inputs of contours", "found": "", "caught": False}
    with tempfile.TemporaryDirectory() as folder:
        for name in (
            "artifacts",
            "conf",
            "data",
            "minesurveys",
            "pipeline",
            "stages",
            "minexplore",
            "dvc.yaml",
            "params.yaml",
        ):
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
            row |= {"found": str(error), "caught": "in the inputs of contours" in str(error)}
    return row


def _print_row(row: dict) -> None:
    """Print the result of one fault."""
    tqdm.write(f"{'caught' if row['caught'] else 'MISSED'}  {row['fault']}: {row['found'][:110]}", file=sys.stdout)
    sys.stdout.flush()


def main() -> int:
    """Inject every fault into the present world, then change a small one at random; exit code 1 if one is missed."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--random", type=int, default=100, help="number of random mutants")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first random mutant")
    add_options(parser)
    arguments = parser.parse_args()
    plan = (
        decode(ARTIFACTS / "contours/cleaned.png", Mask),
        decode(ARTIFACTS / "contours/raw.png", Mask),
        open_survey(ARTIFACTS / "survey/mine").survey,
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
    seeds = list(range(arguments.first_seed, arguments.first_seed + arguments.random))
    verdicts = judge_many(seeds, where_of(arguments))
    caught = sum(row["caught"] for row in rows)
    lost = [verdict for verdict in verdicts if verdict.outcome in (MISSED, CRASHED)]
    summary = summarise(verdicts)
    report = {"total": len(rows), "caught": caught, "rows": rows, "random": summary}
    for table in TABLES:
        write_atomically(table, (json.dumps(report, indent=2) + "\n").encode())
    for verdict in lost:
        print(f"{verdict.outcome}  seed {verdict.seed}: {verdict.change}: {verdict.reason}")
    print(f"{caught} of {len(rows)} caught\n{summary}")
    return 0 if caught == len(rows) and not lost else 1


def _without_stress(params: CertificateParams) -> CertificateParams:
    limits = {k: v for k, v in params.limits.items() if k not in ("contacts", "escapes", "deepest_m")}
    return params.model_copy(update={"contacts": 0, "limits": limits})


if __name__ == "__main__":
    sys.exit(run_benchmark("mutants", main))
