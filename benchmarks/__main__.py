"""`python -m benchmarks NAME [ARGUMENTS]` runs one measurement; without a name it prints the table of them."""

from __future__ import annotations

import difflib
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks import CALLERS_ENVIRONMENT
from pipeline.errors import run_command

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


def _python(
    name: str, needs: str, words: str, writes: str, minutes: str = "", *, one_thread: bool = False
) -> Benchmark:
    """Return the measurement of a module with its first arguments."""
    return Benchmark(name, needs, f'python -m {words} "$@"', writes, minutes, one_thread)


_PARTS = "docs/evidence/parts/"
_WORLD = "--bundle artifacts/realism/world"
_ALL_SPLITS = (
    'for split in validation test train; do python -m pipeline worlds --light --split $split --list "$@"; done'
)
_ROUGHNESS = "pipeline roughness data/raw/sweep_*.csv --out data/chilean_mine/roughness.json"
_STRESS_TEST = f"pipeline certify {_WORLD} --contacts 1000000 --out artifacts/proof/certificate.json"
_PARITY = f"pipeline parity {_WORLD} --out artifacts/proof/parity.json"
_REPLAY = f"pipeline replay {_WORLD} --sweeps data/raw --poses data/raw/scan_poses.csv --out artifacts/proof"
_UNSEEN = (
    "baselines.split --bounds "
    "--policy wall-following nearest-frontier information-gain frontier-tour depth-first two-level"
)
_FIVE_SEEDS = 'for seed in 42 142 242 342 442; do python -m baselines.ppo.train seed=$seed "$@"; done'
_CURVES = 'python -m baselines.ppo.curves "$@"; python -m baselines.graph.training.curves "$@"'
_RENEW = "python -m baselines.oracle; python -m baselines.evaluate --all; python -m baselines.leaderboard"
_RERUN = (
    'for file in $(python -m baselines.scoring.rerun); do python -m baselines.score "$file" --rerun all; done; '
    "python -m baselines.leaderboard"
)
_TRAINING_TESTS = "pytest tests/baselines/ppo/test_ppo.py tests/baselines/graph/test_graph.py"
_GPU_TESTS = "pytest tests/minexplore/extra/warp/test_warp.py tests/baselines/ppo/test_ppo_on_warp.py"
_ENV_PAGE = "python -m minexplore page > docs/reference/.new; mv docs/reference/.new docs/reference/environment.md"

BENCHMARKS: tuple[Benchmark, ...] = (
    # Worlds
    _python("worlds", "setup", "pipeline worlds --light --count 10", "artifacts/families"),
    Benchmark("splits", "setup", _ALL_SPLITS, "data/families/splits.csv", "50"),
    _python("odometry-fit", "setup", "benchmarks.sensors.odometry_fit", "minexplore/sensing/odometry.json"),
    _python("roughness", "setup", _ROUGHNESS, "data/chilean_mine/roughness.json"),
    _python("corpus", "all", "benchmarks.corpus", "artifacts/corpus", "15"),
    # First use
    _python("first-touch", "setup", "benchmarks.first_touch", _PARTS + "first-touch.md", "10"),
    _python("simple-mines", "setup", "benchmarks.simple_mines", _PARTS + "simple-mines.md", "45"),
    _python("files", "setup", "benchmarks.files", "artifacts/bench/files.md"),
    _python("stated-files", "setup", "benchmarks.stated_files", "artifacts/bench/stated-files.md"),
    _python(
        "survey-programs",
        "setup",
        "benchmarks.comparisons.survey_programs",
        "artifacts/bench/survey-programs.md",
    ),
    # Evidence
    _python("stress-test", "all", _STRESS_TEST, "artifacts/proof/certificate.json", "6"),
    _python("mutants", "all", "benchmarks.mutants", "artifacts/proof/mutants.json"),
    _python("parity", "all", _PARITY, "artifacts/proof/parity.json"),
    _python("parity-gpu", "setup-gpu", "benchmarks.speed.gpu_parity", _PARTS + "gpu-parity.md"),
    _python("replay", "all", _REPLAY, "artifacts/proof"),
    _python(
        "holdout",
        "setup",
        "pipeline validate --holdout --out artifacts/proof/holdout.json",
        "artifacts/proof/holdout.json",
    ),
    _python("fuzz", "setup", "benchmarks.fuzz", _PARTS + "fuzz.md"),
    _python("random-mines", "setup", "benchmarks.worlds.random_mines", _PARTS + "random-mines.md"),
    _python("reach", "setup", "benchmarks.worlds.reach", "artifacts/bench/reach.md", "10"),
    _python("random-bends", "setup", "benchmarks.worlds.random_bends", _PARTS + "random-bends.md", "3"),
    _python("scans", "setup", "benchmarks.scans.judge", _PARTS + "scans.md"),
    _python("large-scan", "setup", "benchmarks.scans.large", "nothing", "1"),
    _python("round-trips", "setup", "benchmarks.scans.round_trips", _PARTS + "round-trips.md", "1"),
    _python("drawings", "setup", "benchmarks.pictures.judge_drawings", _PARTS + "drawings.md"),
    _python("leave-out-sweeps", "setup", "benchmarks.comparisons.leave_out_sweeps", _PARTS + "corrected-plan.md"),
    _python("evidence", "all", "benchmarks.evidence", _PARTS + "evidence-figures.md"),
    _python("claims", "setup", "benchmarks.claims", _PARTS + "claims.md"),
    # Comparisons
    _python(
        "volume-gate", "all", "benchmarks.comparisons.volume.gate", _PARTS + "volume-gate.md", "5", one_thread=True
    ),
    _python(
        "volume-throws", "setup", "benchmarks.comparisons.volume.throw_bodies", "artifacts/bench/volume-throws", "5"
    ),
    _python(
        "random-volumes", "setup", "benchmarks.comparisons.volume.random_volumes", _PARTS + "random-volumes.md", "15"
    ),
    _python("volume-large", "setup", "benchmarks.comparisons.volume.large", "artifacts/bench/volume-large.jsonl", "15"),
    _python("splays", "setup", "benchmarks.comparisons.splays", "", "2"),
    _python("peers", "setup", "benchmarks.comparisons.peers", _PARTS + "peers.md", "2", one_thread=True),
    _python("sensors", "all", "benchmarks.sensors.page", _PARTS + "sensors.md", "4", one_thread=True),
    _python("sensing-loss", "all", "benchmarks.sensors.sensing_loss", _PARTS + "sensing-loss.md", "40"),
    _python("wheel-log", "setup", "benchmarks.wheel_log", ""),
    # Pictures
    _python("volume-world", "setup", "benchmarks.pictures.gallery volume", "docs/volume-world.png", "2"),
    _python("scan-picture", "setup", "benchmarks.pictures.gallery scan", "docs/scan.jpg", "3"),
    _python("scan-colours", "setup", "benchmarks.pictures.gallery colours", "docs/scan-colours.jpg"),
    _python("drive-clip", "all", "benchmarks.pictures.gallery drive", "docs/drive.gif"),
    _python("export-picture", "all", "benchmarks.pictures.gallery export", "docs/export.jpg"),
    _python("look", "all", "benchmarks.pictures.look_at_report", "docs/report.png"),
    # Timings
    _python("bench", "setup", "benchmarks.speed.time_env", _PARTS + "env-speed.md", one_thread=True),
    _python("bench-heights", "setup", "benchmarks.speed.time_heights", _PARTS + "levels-speed.md", one_thread=True),
    _python("bench-gpu", "setup-gpu", "benchmarks.speed.time_gpu", _PARTS + "env-speed-gpu.md"),
    _python("bench-light", "setup", "benchmarks.speed.light_worlds", _PARTS + "light-worlds.md", one_thread=True),
    _python("bench-growth", "setup", "benchmarks.speed.growth", _PARTS + "growth.md", one_thread=True),
    _python("bench-deep", "setup", "benchmarks.speed.time_deep", _PARTS + "deep-mines.md", one_thread=True),
    _python("bench-pipeline", "setup", "benchmarks.speed.time_pipeline", _PARTS + "timings.md"),
    _python("time-training", "setup-baselines", "benchmarks.speed.time_training", "artifacts/bench/training.json"),
    # Baselines
    _python("oracle", "all", "baselines.oracle", "baselines/results/bounds.json"),
    _python("explorers", "all", "baselines.evaluate --all", "baselines/results"),
    _python("unseen", "setup", _UNSEEN, "baselines/results/Family-test"),
    _python("published-plan", "setup", "benchmarks.comparisons.published_plan", _PARTS + "published-plan.md"),
    _python("teams", "all", "baselines.team", _PARTS + "team.md"),
    _python("train", "setup-baselines", "baselines.ppo.train", "artifacts/train"),
    _python("train-gpu", "setup-gpu", "baselines.ppo.train_gpu", "artifacts/train"),
    _python("train-graph", "setup-baselines", "baselines.graph.training.train", "artifacts/train", one_thread=True),
    Benchmark("train-all", "setup-baselines", _FIVE_SEEDS, "artifacts/train"),
    Benchmark("curves", "setup", _CURVES, "docs/evidence/parts/training.md, docs/evidence/parts/graph-training.md"),
    Benchmark("renew-benchmark", "all", _RENEW, "baselines/results, LEADERBOARD.md"),
    Benchmark("rerun", "all", _RERUN, "LEADERBOARD.md"),
    _python("leaderboard", "all", "baselines.leaderboard", "LEADERBOARD.md"),
    # Project
    _python("test-train", "setup-baselines", _TRAINING_TESTS, ""),
    _python("test-gpu", "setup-gpu", _GPU_TESTS, ""),
    Benchmark("env-page", "setup", _ENV_PAGE, "docs/reference/environment.md"),
    Benchmark("sbom", "setup", "python -m benchmarks.bill_of_materials", "artifacts/sbom.json"),
    _python("layout", "setup", "benchmarks.tables.layout", _PARTS + "layout.md", "1"),
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


def _end(words: list[str]) -> None:
    sys.exit(main(words))


if __name__ == "__main__":
    sys.exit(run_command("benchmarks", lambda: _end(sys.argv[1:])))
