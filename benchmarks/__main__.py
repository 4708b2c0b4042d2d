"""`python -m benchmarks NAME [ARGUMENTS]` runs one measurement; without a name it prints the table of them."""

from __future__ import annotations

import difflib
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks import CALLERS_ENVIRONMENT

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Benchmark:
    """One measurement: shell commands that run in the project's folder, with the further arguments as `"$@"`."""

    name: str
    needs: str  # the make target that runs first
    command: str
    writes: str
    minutes: str = ""  # of two cores, where known
    one_thread: bool = False  # threads of OpenMP


_SBOM = "cyclonedx-py environment --pyproject pyproject.toml --output-reproducible -o artifacts/sbom.json"
_EXPLORERS = "wall-following nearest-frontier information-gain frontier-tour depth-first two-level"
_REPLAY = "python -m pipeline replay --bundle artifacts/realism/world --sweeps data/raw --poses data/raw/scan_poses.csv"
_TRAINING_TESTS = "tests/baselines/ppo/test_ppo.py tests/baselines/graph/test_graph.py"
_GPU_TESTS = "tests/minexplore/warp/test_warp.py tests/baselines/ppo/test_ppo_on_warp.py"
_RERUN = 'for file in $(python -m baselines.scoring.rerun); do python -m baselines.score "$file" --rerun all; done'
_ALL_SPLITS = (
    'for split in validation test train; do python -m pipeline worlds --light --split $split --list "$@"; done'
)
_CONTACTS = "--contacts 1000000 --out artifacts/proof/certificate.json"

BENCHMARKS: tuple[Benchmark, ...] = (
    # Worlds
    Benchmark("worlds", "setup", 'python -m pipeline worlds --light --count 10 "$@"', "artifacts/families"),
    Benchmark("splits", "setup", _ALL_SPLITS, "data/families/splits.csv", "50"),
    Benchmark(
        "roughness",
        "setup",
        'python -m pipeline roughness data/raw/sweep_*.csv --out data/chilean_mine/roughness.json "$@"',
        "data/chilean_mine/roughness.json",
    ),
    # First use
    Benchmark(
        "first-touch", "setup", 'python -m benchmarks.first_touch "$@"', "docs/evidence/parts/first-touch.md", "10"
    ),
    Benchmark(
        "simple-mines", "setup", 'python -m benchmarks.simple_mines "$@"', "docs/evidence/parts/simple-mines.md", "45"
    ),
    # Evidence
    Benchmark(
        "stress-test",
        "all",
        f'python -m pipeline certify --bundle artifacts/realism/world {_CONTACTS} "$@"',
        "artifacts/proof/certificate.json",
        "6",
    ),
    Benchmark("mutants", "all", 'python -m benchmarks.mutants "$@"', "artifacts/proof/mutants.json"),
    Benchmark(
        "parity",
        "all",
        'python -m pipeline parity --bundle artifacts/realism/world --out artifacts/proof/parity.json "$@"',
        "artifacts/proof/parity.json",
    ),
    Benchmark(
        "parity-gpu", "setup-gpu", 'python -m benchmarks.speed.gpu_parity "$@"', "docs/evidence/parts/gpu-parity.md"
    ),
    Benchmark("replay", "all", f'{_REPLAY} --out artifacts/proof "$@"', "artifacts/proof"),
    Benchmark(
        "holdout",
        "setup",
        'python -m pipeline validate --holdout --out artifacts/proof/holdout.json "$@"',
        "artifacts/proof/holdout.json",
    ),
    Benchmark("fuzz", "setup", 'python -m benchmarks.fuzz "$@"', "docs/evidence/parts/fuzz.md"),
    Benchmark(
        "random-mines", "setup", 'python -m benchmarks.worlds.random_mines "$@"', "docs/evidence/parts/random-mines.md"
    ),
    Benchmark(
        "random-levels",
        "setup",
        'python -m benchmarks.worlds.random_levels "$@"',
        "docs/evidence/parts/random-levels.md",
    ),
    Benchmark(
        "drawn-sheets",
        "setup",
        'python -m benchmarks.pictures.drawn_sheets "$@"',
        "docs/evidence/parts/drawn-sheets.md",
    ),
    Benchmark(
        "leave-out-sweeps",
        "setup",
        'python -m benchmarks.comparisons.leave_out_sweeps "$@"',
        "docs/evidence/parts/corrected-plan.md",
    ),
    Benchmark("evidence", "all", 'python -m benchmarks.evidence "$@"', "docs/evidence/parts/evidence-figures.md"),
    Benchmark("claims", "setup", 'python -m benchmarks.claims "$@"', "docs/evidence/parts/claims.md"),
    # Comparisons
    Benchmark(
        "compare-paper",
        "setup",
        'python -m benchmarks.comparisons.compare_paper "$@"',
        "docs/evidence/parts/compare-paper.md",
    ),
    Benchmark(
        "compare-rock", "all", 'python -m benchmarks.comparisons.compare_rock "$@"', "docs/evidence/parts/rock.md"
    ),
    Benchmark(
        "rock-directions",
        "setup",
        'python -m benchmarks.comparisons.rock_directions "$@"',
        "docs/evidence/parts/rock-directions.md",
    ),
    Benchmark(
        "compare-collision",
        "setup",
        'python -m benchmarks.comparisons.compare_collision "$@"',
        "docs/evidence/parts/compare-collision.md",
    ),
    Benchmark(
        "volume-gate",
        "all",
        'python -m benchmarks.comparisons.volume.gate "$@"',
        "docs/evidence/parts/volume-gate.md",
        one_thread=True,
    ),
    Benchmark(
        "search-texture",
        "setup",
        'python -m benchmarks.comparisons.search_texture "$@"',
        "docs/evidence/parts/texture-search.md",
    ),
    # Pictures
    Benchmark("look-pictures", "all", 'python -m benchmarks.pictures.look_pictures "$@"', "docs/look.jpg"),
    Benchmark("level-pictures", "setup", 'python -m benchmarks.pictures.level_pictures "$@"', "docs/levels.png"),
    Benchmark("decline-pictures", "setup", 'python -m benchmarks.pictures.decline_pictures "$@"', "docs/decline.jpg"),
    Benchmark(
        "case-pictures", "setup", 'python -m benchmarks.pictures.case_pictures "$@"', "docs/evidence/parts/cases.md"
    ),
    Benchmark("drive-clip", "all", 'python -m benchmarks.pictures.drive_clip "$@"', "docs/drive.gif"),
    Benchmark("look", "all", 'python -m benchmarks.pictures.look_at_report "$@"', "docs/report.png"),
    # Timings
    Benchmark(
        "bench",
        "setup",
        'python -m benchmarks.speed.time_env "$@"',
        "docs/evidence/parts/env-speed.md",
        one_thread=True,
    ),
    Benchmark(
        "bench-heights",
        "setup",
        'python -m benchmarks.speed.time_heights "$@"',
        "docs/evidence/parts/levels-speed.md",
        one_thread=True,
    ),
    Benchmark(
        "bench-gpu", "setup-gpu", 'python -m benchmarks.speed.time_gpu "$@"', "docs/evidence/parts/env-speed-gpu.md"
    ),
    Benchmark(
        "bench-light",
        "setup",
        'python -m benchmarks.speed.light_worlds "$@"',
        "docs/evidence/parts/light-worlds.md",
        one_thread=True,
    ),
    Benchmark(
        "bench-growth",
        "setup",
        'python -m benchmarks.speed.growth "$@"',
        "docs/evidence/parts/growth.md",
        one_thread=True,
    ),
    Benchmark(
        "bench-deep",
        "setup",
        'python -m benchmarks.speed.time_deep "$@"',
        "docs/evidence/parts/deep-mines.md",
        one_thread=True,
    ),
    Benchmark(
        "bench-pipeline", "setup", 'python -m benchmarks.speed.time_pipeline "$@"', "docs/evidence/parts/timings.md"
    ),
    Benchmark(
        "time-training",
        "setup-baselines",
        'python -m benchmarks.speed.time_training "$@"',
        "artifacts/bench/training.json",
    ),
    # Baselines
    Benchmark("oracle", "all", 'python -m baselines.oracle "$@"', "baselines/results/bounds.json"),
    Benchmark("explorers", "all", 'python -m baselines.evaluate --all "$@"', "baselines/results"),
    Benchmark(
        "unseen",
        "setup",
        f'python -m baselines.split --bounds --policy {_EXPLORERS} "$@"',
        "baselines/results/Family-test",
    ),
    Benchmark(
        "published-plan",
        "setup",
        'python -m benchmarks.comparisons.published_plan "$@"',
        "docs/evidence/parts/published-plan.md",
    ),
    Benchmark("worst-mines", "setup", 'python -m baselines.worst_mines "$@"', "docs/evidence/parts/worst-mines.md"),
    Benchmark("teams", "all", 'python -m baselines.team "$@"', "docs/evidence/parts/team.md"),
    Benchmark("train", "setup-baselines", 'python -m baselines.ppo.train "$@"', "artifacts/train"),
    Benchmark("train-gpu", "setup-gpu", 'python -m baselines.ppo.train_gpu "$@"', "artifacts/train"),
    Benchmark(
        "train-graph",
        "setup-baselines",
        'python -m baselines.graph.training.train "$@"',
        "artifacts/train",
        one_thread=True,
    ),
    Benchmark(
        "train-all",
        "setup-baselines",
        'for seed in 42 142 242 342 442; do python -m baselines.ppo.train seed=$seed "$@"; done',
        "artifacts/train",
    ),
    Benchmark(
        "compare-graph",
        "setup",
        'python -m baselines.pages.simulator "$@"',
        "docs/evidence/parts/graph-simulator.md",
        one_thread=True,
    ),
    Benchmark(
        "curves",
        "setup",
        'python -m baselines.ppo.curves "$@"; python -m baselines.graph.training.curves "$@"',
        "docs/evidence/parts/training.md, docs/evidence/parts/graph-training.md",
    ),
    Benchmark(
        "renew-benchmark",
        "all",
        "python -m baselines.oracle; python -m baselines.evaluate --all; python -m baselines.leaderboard",
        "baselines/results, LEADERBOARD.md",
    ),
    Benchmark("rerun", "all", f"{_RERUN}; python -m baselines.leaderboard", "LEADERBOARD.md"),
    Benchmark("leaderboard", "all", 'python -m baselines.leaderboard "$@"', "LEADERBOARD.md"),
    # Project
    Benchmark("test-train", "setup-baselines", f'python -m pytest {_TRAINING_TESTS} "$@"', ""),
    Benchmark("test-gpu", "setup-gpu", f'python -m pytest {_GPU_TESTS} "$@"', ""),
    Benchmark(
        "env-page",
        "setup",
        "python -m minexplore page > docs/reference/.new; mv docs/reference/.new docs/reference/environment.md",
        "docs/reference/environment.md",
    ),
    Benchmark("sbom", "setup", f"{_SBOM} .venv/bin/python", "artifacts/sbom.json"),
    Benchmark("provenance", "setup", 'python -m pipeline provenance "$@"', "artifacts/provenance"),
)


def table() -> str:
    """Return the table of the measurements."""
    rows = [("name", "minutes", "after make", "writes"), *((b.name, b.minutes, b.needs, b.writes) for b in BENCHMARKS)]
    return "\n".join(f"{a:17} {b:>7}  {c:16} {d}".rstrip() for a, b, c, d in rows)


def environment_of(benchmark: Benchmark) -> dict[str, str]:
    """Return the caller's environment with the project's Python first on the path."""
    path = f"{ROOT / '.venv' / 'bin'}{os.pathsep}{CALLERS_ENVIRONMENT.get('PATH', os.defpath)}"
    return {**CALLERS_ENVIRONMENT, "PATH": path, **({"OMP_NUM_THREADS": "1"} if benchmark.one_thread else {})}


def main(words: list[str]) -> int:
    """Print the table, or become the command of one measurement; exit code 2 if there is none of that name."""
    if not words or words[0] in ("-h", "--help"):
        print(table())
        return 0
    found = {b.name: b for b in BENCHMARKS}.get(words[0])
    if found is None:
        near = difflib.get_close_matches(words[0], [b.name for b in BENCHMARKS])
        hint = f"nearest names: {', '.join(near)}; " if near else ""
        print(f"benchmarks: no measurement {words[0]!r}; {hint}`python -m benchmarks` lists them", file=sys.stderr)
        return 2
    environment = environment_of(found)
    prepared = subprocess.run(["make", "-s", found.needs], cwd=ROOT, env=environment)
    if prepared.returncode:
        return 2
    os.chdir(ROOT)
    os.execvpe("sh", ["sh", "-ec", found.command, found.name, *words[1:]], environment)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
