"""Change every field of a bundle, one at a time, and check that each change is refused or is a stated claim.

`python -m benchmarks.faults.judge_fields BUNDLE` takes a level world or a volume. `--every N` tries one change of N.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from tqdm import tqdm

from benchmarks.faults.every_field import every_change
from benchmarks.faults.random_faults import reseal
from benchmarks.faults.random_model_faults import Files
from benchmarks.faults.random_mutants import CAUGHT, CRASHED, MISSED, prove
from minexplore.bundle import MESHES, VOLUME
from minexplore.sealed.files import read_folder
from pipeline.commands.proofs import limits_of_kind
from pipeline.errors import MineError
from pipeline.mjcf.bundle import read_made_by
from pipeline.params.validation import ValidationParams
from pipeline.proof.claims import claim_of
from pipeline.proof.rebuilt.fittings import require_furniture
from pipeline.volume.world.proof.alone import certify_alone, survey_alone
from pipeline.volume.world.proof.certificate import open_volume
from pipeline.volume.world.proof.remade import require_remade
from pipeline.volume.world.surface.furnished import hang_again

CLAIM = "claim"


def judge_fields(good: Path, every: int = 1, first: int = 0) -> Iterator[tuple[str, str, str]]:
    """Yield what is changed, the outcome, and the message or the claim; of the meshes the first and the last are."""
    files, params = read_folder(good), limits_of_kind(read_made_by(good).kind, [])
    with tempfile.TemporaryDirectory() as name:
        for what, changed in islice(_chosen(files), first, None, every):
            folder = Path(name) / "world"
            shutil.rmtree(folder, ignore_errors=True)
            for file, data in reseal(changed).items():
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                (folder / file).write_bytes(data)
            yield (what, *_outcome(folder, params, what))


def _chosen(files: Files) -> Iterator[tuple[str, Files]]:
    meshes = sorted(name for name in files if name.startswith(MESHES))
    some = {*meshes[:1], *meshes[-1:]}
    return ((what, changed) for what, changed in every_change(files) if what.partition(":")[0] not in {*meshes} - some)


def _outcome(folder: Path, params: ValidationParams, what: str) -> tuple[str, str]:
    try:
        (prove_volume if (folder / VOLUME).is_file() else prove)(folder, params)
    except MineError as error:
        return CAUGHT, str(error).replace(str(folder), "w")
    except Exception as error:  # the fault that this looks for
        return CRASHED, f"{type(error).__name__}: {error}"
    claim = claim_of(what)
    return (CLAIM, claim) if claim else (MISSED, "")


def prove_volume(folder: Path, params: ValidationParams) -> None:
    """Judge the bundle of a volume as `certify` does, without bodies that are thrown.

    Raises
    ------
    MineError
        With the file, the value and the limit, or the clause.
    """
    world = open_volume(folder)
    require_furniture(folder, world.record.files, params.fittings.furniture, hang_again(folder, world.record.files))
    require_remade(folder, world, params.volume, survey_alone(world, params.volume))
    quiet = params.volume.model_copy(update={"robot_contacts": 0, "ball_contacts": 0})
    for name, clause in certify_alone(world, quiet).clauses.items():
        if not clause.holds:
            raise MineError(f"{folder}: {name} = {clause.value}: limit {clause.limit}")


def main() -> int:
    """Print what is missed, and the counts; exit code 1 if a change is neither refused nor a claim."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("bundle", type=Path)
    parser.add_argument("--every", type=int, default=1, help="try one change of so many")
    arguments = parser.parse_args()
    counts = dict.fromkeys((CAUGHT, CLAIM, MISSED, CRASHED), 0)
    for what, outcome, reason in tqdm(judge_fields(arguments.bundle, arguments.every), desc="fields", disable=None):
        counts[outcome] += 1
        if outcome != CAUGHT:
            tqdm.write(f"{outcome}  {what}: {reason}", file=sys.stdout)
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()))
    return 1 if counts[MISSED] or counts[CRASHED] else 0


if __name__ == "__main__":
    sys.exit(main())
