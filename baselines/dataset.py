"""Write episodes of explorers as Minari data sets: `python -m baselines.dataset --mines 10`; the folder has a card."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import minexplore
from baselines.base.errors import BaselineError, run_command
from baselines.base.markdown import markdown_table
from baselines.base.progress import progress_bar
from baselines.policies.policy_lookup import make_policy
from minexplore.splits import SIZES, mine_name

EXPLORERS = ("nearest-frontier", "information-gain", "wall-following")
OUT = Path("artifacts/datasets")
_NAMESPACE, _PACKAGE = "minexplore", "minari[create,hdf5]"
_CARD = """# Episodes of explorers in generated mines

Written by `python -m baselines.dataset`. Each data set has one episode of one explorer in each of {mines} mines of the
split `{split}`, at most {steps:,} control steps of 0.1 s each, of `MineXplore/Family-v0`. `minari.load_dataset` reads
them with `MINARI_DATASETS_PATH` set to the folder that this one is in; `recover_environment` needs `import minexplore`
and the mines, which `python -m benchmarks worlds --count {mines} --split {split}` builds.

{table}
An observation has sixteen ranges and the last command, an action forward speed and turn rate; infos hold coverage,
collisions and the true pose, by which the explorers map. Meaning, units and limits:
`docs/reference/environment.md`. Explorers: `docs/reference/benchmark.md`. Seed i is that of the episode in mine i.

Limits: the mines are generated, not surveyed; the explorers know their true pose; no sensor is degraded. Licence:
Apache-2.0, as the code that made mines and episodes.

MineXplore {version}. Worlds, by SHA-256:

{worlds}
"""


def write_episodes(
    explorer: str, split: str, mines: int, steps: int, families: Path | None, worlds: dict[str, str]
) -> tuple[str, int, int, float]:
    """Drive an explorer in the first mines of a split and write its data set; note the hashes of their worlds.

    Returns
    -------
    (str, int, int, float)
        The data set's name, its episodes and steps, and the mean coverage at the end.

    Raises
    ------
    BaselineError
        If a mine is not built, or there is a data set of this name.
    """
    from minari import DataCollector

    name = f"{_NAMESPACE}/{explorer}-v0"
    given: dict[str, Any] = {} if families is None else {"families": str(families.resolve())}
    inner = gymnasium.make(minexplore.FAMILY, split=split, mines=mines, max_episode_steps=steps, **given)
    env = DataCollector(inner, record_infos=True)
    family = env.unwrapped
    policy = make_policy(explorer, 1, family.task, family.robot)
    progress, covered, total = progress_bar(f"{explorer} in {mines} mines", mines * steps), [], 0
    for number in range(mines):
        try:
            observation, info = env.reset(seed=number, options={"mine": mine_name(split, number)})
        except FileNotFoundError as error:
            raise BaselineError(str(error)) from error
        worlds[str(family.mine)] = family.world.record["world_sha256"]
        policy.reset(np.zeros(1, int), np.array([number]))
        over = False
        while not over:
            rows = {key: np.asarray(value)[None] for key, value in info.items()}
            action = np.asarray(policy.act(observation[None], rows), np.float32)[0]
            observation, _, terminated, truncated, info = env.step(action)
            over, total = terminated or truncated, total + 1
            progress.update(1)
        covered.append(float(info["coverage"]))
    progress.close()
    try:
        env.create_dataset(
            name,
            algorithm_name=explorer,
            author="The MineXplore maintainers",
            code_permalink="https://github.com/minexplore/minexplore",
            description=f"{explorer} in {mines} generated mines of the split {split}",
        )
    except ValueError as error:
        raise BaselineError(f"{name}: {error}") from error
    env.close()
    return name, mines, total, float(np.mean(covered))


def write_all(out: Path, explorers: Sequence[str], split: str, mines: int, steps: int, families: Path | None) -> Path:
    """Write a data set for each explorer and the card below a folder; return the card's path; for errors see above."""
    os.environ["MINARI_DATASETS_PATH"] = str(out)
    out.mkdir(parents=True, exist_ok=True)
    taken = [name for name in explorers if (out / _NAMESPACE / f"{name}-v0").exists()]
    if taken:
        raise BaselineError(f"{out / _NAMESPACE / taken[0]}-v0: is there; remove it, or give another folder by --out")
    worlds: dict[str, str] = {}
    rows = []
    for explorer in explorers:
        name, episodes, total, covered = write_episodes(explorer, split, mines, steps, families, worlds)
        size = sum(path.stat().st_size for path in (out / name).rglob("*") if path.is_file())
        rows.append((f"`{name}`", episodes, f"{total:,}", f"{covered:.1%}", f"{size / 1e6:.1f}"))
    table = markdown_table(("data set", "episodes", "steps", "mean coverage at the end", "MB"), rows)
    hashes = "\n".join(f"- {name} `{sha256}`" for name, sha256 in worlds.items())
    facts = {"mines": mines, "split": split, "steps": steps, "table": table, "worlds": hashes}
    card = out / _NAMESPACE / "README.md"
    card.write_text(_CARD.format(**facts, version=minexplore.__version__))
    return card


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.dataset", description=__doc__)
    parser.add_argument("--explorers", nargs="*", choices=EXPLORERS, default=list(EXPLORERS))
    parser.add_argument("--split", choices=list(SIZES), default="train")
    parser.add_argument("--mines", type=int, default=10, help="the first so many of the split")
    parser.add_argument("--steps", type=int, default=6000, help="of an episode at most")
    parser.add_argument("--families", type=Path, help="folder of the mines; artifacts/families by default")
    parser.add_argument("--out", type=Path, default=OUT)
    arguments = parser.parse_args()
    most = SIZES[arguments.split]
    if not 1 <= arguments.mines <= most or not 1 <= arguments.steps <= 100_000:
        raise BaselineError(f"mines = {arguments.mines}, steps = {arguments.steps}: want 1 to {most}, 1 to 100,000")
    try:
        import minari  # noqa: F401
    except ImportError as error:
        raise BaselineError(f"minari is not installed; `pip install '{_PACKAGE}'` does it") from error
    given = (arguments.explorers, arguments.split, arguments.mines, arguments.steps, arguments.families)
    print(write_all(arguments.out, *given).read_text())


if __name__ == "__main__":
    sys.exit(run_command("dataset", main))
