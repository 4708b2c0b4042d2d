"""Work in several processes: episodes of a policy, which do not depend on what runs beside them, and other items."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed, wait
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import gymnasium
from gymnasium.envs.registration import EnvSpec

from baselines.base.environments import make_env
from baselines.base.result_file import Episode
from baselines.base.worker import begin_worker
from baselines.policies.policy_lookup import make_policy
from baselines.running.protocol import run_episodes
from baselines.sandbox.confined import Confined, ConfinedPolicy

Item = TypeVar("Item")
_POLL_S = 1.0
_steps_done: Any = None  # the steps that all workers have made


def drive(
    policy_name: str,
    env_id: str,
    seeds: list[int],
    step_done: Callable[[int], Any],
    jobs: int = 1,
    confined: Confined | None = None,
) -> list[Episode]:
    """Run one episode of each seed in `jobs` processes and return the episodes in the order of the seeds.

    `step_done` is called now and then with the number of new robot steps. With `confined` the policy runs in a confined
    process beside each of the `jobs`.
    """
    jobs = min(jobs, len(seeds))
    if jobs == 1:
        return _drive_part(policy_name, env_id, seeds, step_done, confined)
    with _copies_removed(confined) as confined:
        return _drive_in_pool(policy_name, env_id, seeds, step_done, jobs, confined)


@contextmanager
def _copies_removed(confined: Confined | None) -> Iterator[Confined | None]:
    """Let copies of a policy lie in a folder that this process removes: a worker that is ended removes nothing."""
    if confined is None:
        yield None
        return
    with TemporaryDirectory(prefix="policy-") as folder:
        yield replace(confined, folder=Path(folder))


def _drive_in_pool(
    policy_name: str,
    env_id: str,
    seeds: list[int],
    step_done: Callable[[int], Any],
    jobs: int,
    confined: Confined | None,
) -> list[Episode]:
    context = multiprocessing.get_context("spawn")  # a fork takes none of this process's threads along
    counter = context.Value("q", 0)
    parts = [seeds[k::jobs] for k in range(jobs)]
    pool = ProcessPoolExecutor(jobs, context, _begin, (gymnasium.spec(env_id), counter))
    try:
        futures = [pool.submit(_drive_counting, policy_name, env_id, part, confined) for part in parts]
        waiting, shown = set(futures), 0
        while waiting:
            waiting = wait(waiting, _POLL_S).not_done
            now = counter.value
            step_done(now - shown)
            shown = now
        episodes = {episode.seed: episode for future in futures for episode in future.result()}
    except BaseException:
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        pool.shutdown()
    return [episodes[seed] for seed in seeds]


def in_processes(work: Callable[[Item], Any], items: list[Item], jobs: int) -> Iterator[tuple[Item, Any]]:
    """Yield each item with what `work` returns for it, in the order in which the `jobs` processes finish."""
    if jobs == 1:
        for item in items:
            yield item, work(item)
        return
    pool = ProcessPoolExecutor(min(jobs, max(len(items), 1)), multiprocessing.get_context("spawn"), begin_worker)
    try:
        waiting = {pool.submit(work, item): item for item in items}
        for future in as_completed(waiting):
            yield waiting[future], future.result()
    except BaseException:
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(spec: EnvSpec, counter: Any) -> None:
    """Prepare a worker that knows its parent's environment."""
    global _steps_done
    gymnasium.registry.setdefault(spec.id, spec)
    _steps_done = counter
    begin_worker()


def _drive_counting(policy_name: str, env_id: str, seeds: list[int], confined: Confined | None) -> list[Episode]:
    def count(steps: int) -> None:
        with _steps_done.get_lock():
            _steps_done.value += steps

    return _drive_part(policy_name, env_id, seeds, count, confined)


def _drive_part(
    policy_name: str, env_id: str, seeds: list[int], step_done: Callable[[int], Any], confined: Confined | None
) -> list[Episode]:
    env = make_env(env_id, len(seeds))
    heights = env.world.has_heights
    try:
        if confined is None:
            policy = make_policy(policy_name, len(seeds), env.task, env.robot, heights)
            return list(run_episodes(env, policy, seeds, step_done))
        with ConfinedPolicy(policy_name, len(seeds), env.task, env.robot, confined, heights) as driver:
            return list(run_episodes(env, driver, seeds, step_done))
    finally:
        env.close()
