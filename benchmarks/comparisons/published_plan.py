"""Policies in the published plan of the embedded mine: `python -m benchmarks published-plan`.

The embedded mine is a station survey of this plan, so the two worlds have the same drifts and other walls.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import gymnasium

from baselines.base.environments import make_env
from baselines.base.errors import BaselineError
from baselines.base.markdown import markdown_table, write_table
from baselines.base.result_file import read_results, replace_text
from baselines.base.statistics import as_text, figures
from baselines.evaluate import evaluate, expected_head, is_current
from baselines.policies.policy_lookup import policy_label
from baselines.running.protocol import SEEDS
from baselines.scoring.bounds import Bound
from baselines.split import bound_at_the_end
from benchmarks.resume import run_benchmark
from pieces.work import Where, add_options, where_of
from pipeline.build.world import make_world
from pipeline.compose import compose

ENV = "MineXplore/PublishedPlan-v0"
POLICIES = ("nearest-frontier", "graph-142")
_SOURCE, _FOLDER = Path("data/raw/plan.jpg"), Path("artifacts/benchmarks/published_plan")
_BOUND, _PAGE = _FOLDER / "bound.json", Path("docs/evidence/parts/published-plan.md")
_SHOWN = ("coverage at 300 s", "coverage at 600 s", "share of bound at 600 s", "area under coverage",
          "collisions per 100 m", "path, m")  # fmt: skip


def build() -> None:
    """Bring the world up to date and register its environment.

    Raises
    ------
    BaselineError
        If the plan is missing.
    MineError
        If a stage fails.
    """
    if not _SOURCE.is_file():
        raise BaselineError(f"{_SOURCE}: missing; `make data` fetches it")
    make_world(compose(["survey=plan"]), _FOLDER)
    spec = gymnasium.spec("MineXplore/ChileanMine-v0")
    gymnasium.register(
        ENV,
        spec.entry_point,
        vector_entry_point=spec.vector_entry_point,
        kwargs={"world": (_FOLDER / "realism" / "world").resolve()},
        order_enforce=True,
    )


def known_bound() -> Bound:
    """Return the bound at the end of an episode; one that was computed in this world is kept."""
    env = make_env(ENV, 1)
    world = env.world.record["world_sha256"]
    env.close()
    if _BOUND.is_file():
        kept = Bound.model_validate_json(_BOUND.read_bytes())
        if kept.world_sha256 == world:
            return kept
    bound = bound_at_the_end((ENV, world))
    replace_text(_BOUND, bound.model_dump_json() + "\n")
    return bound


def drive(policy: str, where: Where) -> None:
    """Drive a policy's episodes; results that are current are kept."""
    env = make_env(ENV, 1)
    head = expected_head(policy, ENV, env, list(SEEDS))
    env.close()
    if not is_current(_results(policy), head):
        evaluate(policy, ENV, list(SEEDS), _results(policy), where)


def tables(policies: list[str], bound: Bound) -> str:
    """Return the table: the policy that sees most first."""
    found = [(policy, figures(*read_results(_results(policy)), bound.at)) for policy in policies]
    found.sort(key=lambda row: -(row[1]["coverage at 600 s"].value or 0.0))
    rows = ((policy_label(policy), *(as_text(n, own[n]) for n in _SHOWN)) for policy, own in found)
    share = bound.most[-1] / bound.cells
    return (
        f"World `{bound.world_sha256[:12]}`, {bound.cells:,} cells. No robot can have seen more than "
        f"{bound.most[-1]:,} of them ({share:.1%}) at 600 s; the best\nwalk that was found sees {bound.found[-1]:,}. "
        f"Full task, {len(SEEDS)} seeds.\n\n{markdown_table(['policy', *_SHOWN], rows)}"
    )


def _results(policy: str) -> Path:
    return _FOLDER / "results" / f"{policy_label(policy)}.jsonl"


def main() -> int:
    """Build the world, drive in it, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.comparisons.published_plan", description=__doc__)
    parser.add_argument("--policy", nargs="+", default=list(POLICIES), help="names or checkpoints NAME.safetensors")
    add_options(parser, min(os.cpu_count() or 1, 4))
    arguments = parser.parse_args()
    build()
    bound = known_bound()
    for policy in arguments.policy:
        drive(policy, where_of(arguments))
    write_table(_PAGE, tables(arguments.policy, bound))
    print(f"{_PAGE} is written")
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("published-plan", main))
