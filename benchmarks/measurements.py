"""The table of the measurements: for each its make target, its command, the files that it writes, and its minutes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Benchmark:
    """One measurement: shell commands that run in the project's folder, with the further arguments as `"$@"`."""

    name: str
    needs: str  # the make target that runs first
    command: str
    writes: str
    minutes: float | None = None  # of two cores, where known; each page of evidence has them
    one_thread: bool = False  # threads of OpenMP
    default_world: bool = False  # whether its pages are measured in the world of `make all`

    @property
    def extra(self) -> str:
        """Return the extra whose set-up it needs, which changes the packages of `.venv`; empty for none."""
        return self.needs.partition("setup-")[2]

    @property
    def pages(self) -> list[str]:
        """Return the pages of evidence that it writes."""
        return [name for name in self.writes.split(", ") if name.startswith(_PARTS)]


def _python(name: str, needs: str, words: str, writes: str, minutes: float | None = None, **more: bool) -> Benchmark:
    """Return the measurement of a module with its first arguments."""
    return Benchmark(name, needs, f'python -m {words} "$@"', writes, minutes, **more)


def _page(name: str, needs: str, words: str, minutes: float, page: str = "", **more: bool) -> Benchmark:
    """Return the measurement of a module that writes a page of evidence, of its own name if none is stated."""
    return _python(name, needs, words, f"{_PARTS}{page or name}.md", minutes, **more)


_PARTS = "docs/evidence/parts/"
_WORLD = "--bundle artifacts/realism/world"
_ALL_SPLITS = (
    'for split in validation test train; do python -m pipeline worlds --light --split $split --list "$@"; done'
)
_ROUGHNESS = "pipeline roughness data/raw/sweep_*.csv --out data/chilean_mine/roughness.json"
_STRESS_TEST = f"pipeline certify {_WORLD} --contacts 100000 --out artifacts/proof/certificate.json"
_PARITY = f"pipeline parity {_WORLD} --out artifacts/proof/parity.json"
_REPLAY = f"pipeline replay {_WORLD} --sweeps data/raw --poses data/raw/scan_poses.csv --out artifacts/proof"
_HOLDOUT = "pipeline validate --holdout --out artifacts/proof/holdout.json"
_FIGURES = " && ".join(
    f"python -m {words}"
    for words in (_STRESS_TEST, "benchmarks.mutants", _PARITY, _HOLDOUT, "benchmarks.proof_figures")
)
_UNSEEN = (
    "baselines.split --bounds "
    "--policy wall-following nearest-frontier information-gain frontier-tour depth-first two-level"
)
_FIVE_SEEDS = 'for seed in 42 142 242 342 442; do python -m baselines.ppo.train seed=$seed "$@"; done'
_RENEW = "python -m baselines.oracle; python -m baselines.evaluate --all; python -m baselines.leaderboard"
_RERUN = (
    'for file in $(python -m baselines.scoring.rerun); do python -m baselines.score "$file" --rerun all; done; '
    "python -m baselines.leaderboard"
)
_TRAINING_TESTS = "pytest baselines/tests/ppo/test_ppo.py baselines/tests/graph/test_graph.py"
_GPU_TESTS = "pytest tests/minexplore/extra/warp/test_warp.py baselines/tests/ppo/test_ppo_on_warp.py"
_ENV_PAGE = "python -m minexplore page > docs/reference/.new; mv docs/reference/.new docs/reference/environment.md"

BENCHMARKS: tuple[Benchmark, ...] = (
    # Worlds
    _python("worlds", "setup", "pipeline worlds --light --count 10", "artifacts/families"),
    Benchmark("splits", "setup", _ALL_SPLITS, "data/families/splits.csv", 50),
    _python("wheel-log", "setup", "benchmarks.sensors.wheel_log", ""),
    _python("odometry-fit", "setup", "benchmarks.sensors.odometry_fit", "minexplore/sensing/odometry.json"),
    _python("roughness", "setup", _ROUGHNESS, "data/chilean_mine/roughness.json"),
    _python("corpus", "all", "benchmarks.corpus", "artifacts/corpus", 15),
    # What newcomers bring
    _page("simple-mines", "setup", "benchmarks.simple_mines", 8),
    _python("files", "setup", "benchmarks.files", "artifacts/bench/files.md"),
    _python("simple-slabs", "setup", "benchmarks.comparisons.one_model.slabs", "", 3),
    _page("fuzz", "setup", "benchmarks.fuzz", 4),
    _page("random-mines", "setup", "benchmarks.worlds.random_mines", 2),
    _page("volumes", "setup", "benchmarks.comparisons.volume.random_volumes", 4),
    _python("explorers-with-heights", "setup", "benchmarks.comparisons.volume.explorers", ""),
    _page("scans", "setup", "benchmarks.scans.judge", 5),
    _page("round-trips", "setup", "benchmarks.scans.round_trips", 1),
    _page("drawings", "setup", "benchmarks.pictures.judge_drawings", 1.5),
    _python("splays", "setup", "benchmarks.comparisons.splays", "", 2),
    _python("random-bends", "setup", "benchmarks.worlds.random_bends", "", 3),
    _python("reach", "setup", "benchmarks.worlds.reach", "artifacts/bench/reach.md", 10),
    # Proof
    _python("stress-test", "all", _STRESS_TEST, "artifacts/proof/certificate.json", 3),
    _python("mutants", "all", "benchmarks.mutants", "artifacts/proof/mutants.json", 5),
    _python("parity", "all", _PARITY, "artifacts/proof/parity.json"),
    _python("holdout", "setup", _HOLDOUT, "artifacts/proof/holdout.json"),
    _python("replay", "all", _REPLAY, "artifacts/proof"),
    Benchmark("figures", "all", _FIGURES, _PARTS + "evidence-figures.md", 12, default_world=True),
    _page("claims", "all", "benchmarks.claims", 0.2, default_world=True),
    _python("one-model", "setup", "benchmarks.comparisons.one_model.whole", "", 20, one_thread=True),
    # Speed
    _page("bench", "all", "benchmarks.speed.time_env", 1, "env-speed", one_thread=True, default_world=True),
    _page("bench-growth", "setup", "benchmarks.speed.growth", 4, "growth", one_thread=True),
    _page("pieces", "setup-baselines", "benchmarks.speed.pieces", 6),
    _page("bench-pipeline", "setup", "benchmarks.speed.time_pipeline", 4, "timings"),
    _python("two-codes", "setup", "benchmarks.speed.two_codes", ""),
    _page("sensors", "all", "benchmarks.sensors.page", 1, one_thread=True, default_world=True),
    _page("bench-gpu", "setup-gpu", "benchmarks.speed.time_gpu", 10, "env-speed-gpu", default_world=True),
    _page("parity-gpu", "setup-gpu", "benchmarks.speed.gpu_parity", 15, "gpu-parity", default_world=True),
    # Pictures
    _python("drive-clip", "all", "benchmarks.pictures.gallery drive", "docs/drive.gif"),
    _python("look", "all", "benchmarks.pictures.look_at_report", "docs/report.png"),
    # Baselines
    _python("oracle", "all", "baselines.oracle", "baselines/results/bounds.json"),
    _python("explorers", "all", "baselines.evaluate --all", "baselines/results"),
    _python("unseen", "setup", _UNSEEN, "baselines/results/Family-test"),
    _page("teams", "all", "baselines.team", 3, "team", default_world=True),
    _page("goals", "all", "baselines.goto", 2, "goto", default_world=True),
    _python("sensing-loss", "all", "benchmarks.sensors.sensing_loss", "baselines/results/degraded.json", 25),
    _python("train", "setup-baselines", "baselines.ppo.train", "artifacts/train"),
    _python("train-gpu", "setup-gpu", "baselines.ppo.train_gpu", "artifacts/train"),
    _python("train-graph", "setup-baselines", "baselines.graph.training.train", "artifacts/train", one_thread=True),
    Benchmark("train-all", "setup-baselines", _FIVE_SEEDS, "artifacts/train"),
    _python("curves", "setup", "baselines.ppo.curves", f"{_PARTS}training.md", 0.1),
    Benchmark("renew-benchmark", "all", _RENEW, "baselines/results, LEADERBOARD.md"),
    Benchmark("rerun", "all", _RERUN, "LEADERBOARD.md"),
    _python("leaderboard", "all", "baselines.leaderboard", "LEADERBOARD.md"),
    # Project
    _python("test-train", "setup-baselines", _TRAINING_TESTS, ""),
    _python("test-gpu", "setup-gpu", _GPU_TESTS, ""),
    Benchmark("env-page", "setup", _ENV_PAGE, "docs/reference/environment.md"),
    Benchmark("sbom", "setup", "python -m benchmarks.bill_of_materials", "artifacts/sbom.json"),
    _python("layout", "setup", "benchmarks.tables.layout", ""),
    _python("dependencies", "setup", "benchmarks.tables.dependencies", "requirements/README.md"),
)
