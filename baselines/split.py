"""Policies on mines that nobody trained in: `python -m baselines.split --policy frontier-tour` and `--bounds`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from baselines.base.environments import built_ids, make_env, world_of
from baselines.base.errors import BaselineError, run_command
from baselines.base.result_file import RESULTS, Head
from baselines.evaluate import is_same
from baselines.oracle.bound import best_walk
from baselines.oracle.other_robots import network_of
from baselines.policies.policy_lookup import make_policy, policy_label
from baselines.running.parallel import MEMORY_GB, code_of_episodes, facts_of_env
from baselines.running.protocol import SPLIT_SEEDS, head_of, run_episodes
from baselines.scoring.bounds import Bound, bounds_file, read_bounds, write_bound
from baselines.scoring.split_file import Drive, read_drives, split_folder, write_drives
from baselines.scoring.verified_runs import note_driven, was_driven_here
from minexplore.splits import SIZES
from pieces.run import map_pieces
from pieces.work import HERE, KEPT, Where, Work, add_options, where_of

Mine = tuple[str, str]  # an environment, and the hash of its world and settings
_BANDS, _LIMIT_S = 100, 20.0  # of a bound: bands of the horizon, and seconds of the solver


def evaluate_split(policy: str, split: str, where: Where = HERE, most: int | None = None) -> list[Drive]:
    """Drive one episode in each mine of a split; episodes that are current and were driven here are kept.

    Raises
    ------
    BaselineError
        If the policy is unknown, or a mine is not built.
    """
    path = split_folder(split) / f"{policy_label(policy)}.jsonl"
    ids = built_ids(split, SIZES[split] if most is None else most)
    kept = {head.env: (head, episode) for head, episode in _driven_here(path)}
    current = {env: drive for env, drive in kept.items() if env in ids and is_same(drive[0], _expected(policy, env))}
    missing = [env for env in ids if env not in current]
    if missing:
        whole = "" if ":" in policy else _expected(policy, missing[0]).policy_sha256  # as `evaluate` has it
        made = _made("mines", partial(_drive, policy), Drive, missing, where, (policy_label(policy), whole))
        current |= zip(missing, made, strict=True)
    drives = [current[env] for env in ids]
    ours = drives[0][0].policy_sha256  # with --mines, the same policy's other mines stay in the file
    beyond = [kept[env] for env in sorted(set(kept) - set(ids)) if kept[env][0].policy_sha256 == ours]
    write_drives(path, drives + beyond)
    return _note(path)[: len(drives)]


def _note(path: Path) -> list[Drive]:
    """Keep that a file's drives were driven here, and return them as they are written."""
    drives = read_drives(path)
    note_driven(path, RESULTS, drives[0][0], [episode for _, episode in drives])
    return drives


def _driven_here(path: Path) -> list[Drive]:
    """Return a kept file's drives; none of one that somebody sent, which is driven again and replaced."""
    if not path.is_file():
        return []
    drives = read_drives(path)
    if was_driven_here(path, RESULTS, drives[0][0], [episode for _, episode in drives]):
        return drives
    print(f"{path}: was not driven here; it is driven again and replaced", file=sys.stderr)
    return []


def _made(title: str, do: Callable[[Any], Any], kind: Any, ids: list[str], where: Where, of: tuple[str, str]) -> Any:
    """Return what is made in each mine; what an interrupted call made is kept, unless `of` has no hash of a policy."""
    kept = KEPT if all(of) else None
    label = f"{of[0]} in {{0[0]}}".format
    work = Work(title, do, kind, code_of_episodes(), of, kept, memory_gb=MEMORY_GB, label=label)
    return map_pieces(work, [(env_id, facts_of_env(env_id)) for env_id in ids], where)


def bound_split(split: str, where: Where = HERE, most: int | None = None) -> dict[str, Bound]:
    """Compute the bound of each mine of a split at the end of its episodes; what is current is kept."""
    ids = built_ids(split, SIZES[split] if most is None else most)
    known = read_bounds(bounds_file(ids[0]))
    missing = [env for env in ids if env not in known or known[env].world_sha256 != world_of(env)]
    made = _made("bounds", bound_at_the_end, Bound, missing, where, ("bound", f"{_BANDS} {_LIMIT_S}"))
    for env_id, bound in zip(missing, made, strict=True):
        write_bound(env_id, bound)
    return read_bounds(bounds_file(ids[0]))


def _expected(policy: str, env_id: str) -> Head:
    env = make_env(env_id, 1)
    try:
        made = make_policy(policy, 1, env.task, env.robot)
        return head_of(env_id, env, policy_label(policy), made, list(SPLIT_SEEDS))
    finally:
        env.close()


def _drive(policy: str, mine: Mine) -> Drive:
    """Drive the episode of one mine."""
    env = make_env(mine[0], 1)
    try:
        made = make_policy(policy, 1, env.task, env.robot)
        head = head_of(mine[0], env, policy_label(policy), made, list(SPLIT_SEEDS))
        return head, next(run_episodes(env, made, list(SPLIT_SEEDS)))
    finally:
        env.close()


def bound_at_the_end(mine: Mine) -> Bound:
    """Return the bound of one mine at the end of an episode."""
    env = make_env(mine[0], 1)
    try:
        horizon = env.task.max_steps * env.task.control_s
        walk = best_walk(network_of(env.robots, horizon / _BANDS), horizon, _LIMIT_S)
        world = env.world.record["world_sha256"]
        return Bound(
            world_sha256=world, cells=env.robots.grid.total, time_s=[horizon], most=[walk.most], found=[walk.found]
        )
    finally:
        env.close()


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="python -m baselines.split", description=__doc__)
    parser.add_argument("--policy", nargs="*", default=[], help="names, module:Class, or checkpoints NAME.safetensors")
    parser.add_argument("--split", default="test", choices=("validation", "test"))
    parser.add_argument("--mines", type=int, help="the first so many; all by default")
    parser.add_argument("--bounds", action="store_true", help="compute the bounds")
    add_options(parser, min(os.cpu_count() or 1, 16))
    arguments = parser.parse_args()
    size = SIZES[arguments.split]
    if not 1 <= (size if arguments.mines is None else arguments.mines) <= size:
        raise BaselineError(f"mines = {arguments.mines}: want 1 to {size}")
    if not arguments.policy and not arguments.bounds:
        raise BaselineError("nothing to do: give --policy or --bounds")
    where = where_of(arguments)
    wanted = where.piece and where.piece.partition(" in ")[0]
    if arguments.bounds and wanted in (None, "bound"):
        bound_split(arguments.split, where, arguments.mines)
    for policy in (name for name in arguments.policy if wanted in (None, policy_label(name))):
        evaluate_split(policy, arguments.split, where, arguments.mines)


if __name__ == "__main__":
    sys.exit(run_command("split", main))
