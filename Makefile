# Thin aliases; `dvc.yaml` is the pipeline. `make all OVERRIDES="survey=plan contours.tolerance_m=0.3"` changes a run.
SHELL := /bin/sh
export PATH := $(CURDIR)/.venv/bin:$(PATH)
export OVERRIDES ?=
SEED ?= 42
N ?= 10
SPLIT ?= train
RANDOM_MUTANTS ?= 300
PY := .venv/bin/python
LOCK := --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header
STAGES := survey contours compile3d surface realism validation

.DEFAULT_GOAL := help
.PHONY: help $(STAGES) setup all test check clean report verify update-baseline data worlds splits roughness stress-test mutants parity replay holdout fuzz random-mines evidence compare-paper compare-rock rock-directions look-pictures drive-clip compare-collision search-texture bench bench-heights bench-light bench-pipeline time-training setup-baselines setup-gpu parity-gpu bench-gpu train-gpu test-gpu oracle explorers teams unseen published-plan worst-mines train train-graph compare-graph train-all curves renew-benchmark rerun leaderboard claims test-slow test-train docs look env-page wheel sbom provenance dag lock bench-growth bench-deep random-levels leave-out-sweeps drawn-sheets

help:  # show the targets that have a remark of two hashes; rarer ones have one
	@awk -F ':.*## ' '/^##@/ {print substr($$0, 5)} /^all:/ {printf "  %-18s %s\n", "$(firstword $(STAGES)) ...", "up to and including one stage: $(STAGES)"} /^[a-z-]+:.*## / {printf "  %-18s %s\n", $$1, $$2}' Makefile

##@ Every day

setup:  ## make .venv from the lock, install missing system packages; silent when done
	@sh requirements/setup.sh dev

all: setup  ## run the whole pipeline (dvc repro)
	@$(PY) -m pipeline set-overrides
	@dvc repro

# Two workers fill two cores: more threads of BLAS than one each would wait for each other.
test: setup  ## run the tests, without the slow ones
	@OMP_NUM_THREADS=1 $(PY) -m pytest -n 2 --dist worksteal -m "not slow" tests

check: setup  ## lint, types, import contracts, dvc.yaml up to date
	@ruff check . && ruff format --check . && mypy && lint-imports && $(PY) -m stages | cmp - dvc.yaml

clean:  ## remove artifacts and caches, keep .venv, data and the metrics that git tracks
	@find artifacts ! -type d ! -path artifacts/.gitignore ! -path artifacts/validation/metrics.json -delete
	@find artifacts -mindepth 1 -type d -empty -delete
	@rm -rf .dvc/cache .dvc/tmp .pytest_cache .mypy_cache .ruff_cache .hypothesis dvc_plots
	@find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

# One stage and those before it: make contours OVERRIDES="contours.tolerance_m=0.15"
$(STAGES): setup
	@$(PY) -m pipeline set-overrides
	@dvc repro $@


##@ Results

report: all  ## write docs/results.md, README's table and pictures; the page is artifacts/report/report.html
	@$(PY) -m pipeline update-results

verify: setup  ## check the hashes from the survey to the world
	@$(PY) -m pipeline verify

update-baseline: setup  ## accept the present metrics for the regression gate
	@$(PY) -m pipeline update-baseline

data: setup  ## fetch the published plan and sweeps into data/raw (MIRROR=address or folder)
	@$(PY) -m pipeline.survey.fetch $(if $(MIRROR),--mirror "$(MIRROR)")

worlds: setup  ## generate light mines: N=1000 SPLIT=train|validation|test; with rock: ROCK=1; variants: ARGS="--of NAME"
	@$(PY) -m pipeline worlds --count $(N) --split $(SPLIT) $(if $(ROCK),,--light) $(ARGS)

splits: setup  ## build all 1,250 light mines and write their hashes to data/families/splits.csv (50 minutes of 2 cores)
	@for split in validation test train; do $(PY) -m pipeline worlds --light --split $$split --list $(ARGS) || exit $$?; done

roughness: setup  # measure the sweeps below data/raw
	@$(PY) -m pipeline roughness data/raw/sweep_*.csv --out data/chilean_mine/roughness.json


##@ Evidence

stress-test: all  ## drive robots against the walls: a million contacts
	@$(PY) -m pipeline certify --bundle artifacts/realism/world --contacts 1000000 --out artifacts/proof/certificate.json

mutants: all  ## put faults into worlds, listed and random (RANDOM_MUTANTS=2000); the validator must find each
	@$(PY) -m benchmarks.mutants --random $(RANDOM_MUTANTS)

parity: all  ## cast the same rays by every backend
	@$(PY) -m pipeline parity --bundle artifacts/realism/world --out artifacts/proof/parity.json

parity-gpu: setup-gpu  ## the environment on a GPU beside that on the CPU (ARGS="--device cpu --robots 64" without one)
	@$(PY) -m benchmarks.speed.gpu_parity $(ARGS)

replay: all  ## replay the sweeps below data/raw in the world
	@$(PY) -m pipeline replay --bundle artifacts/realism/world --sweeps data/raw --poses data/raw/scan_poses.csv --out artifacts/proof

leave-out-sweeps: setup  ## correct the published plan by all sweeps but one, measure that one
	@$(PY) -m benchmarks.comparisons.leave_out_sweeps

drawn-sheets: setup  ## find the workings on 1,400 drawing sheets: right, asked, wrong
	@$(PY) -m benchmarks.pictures.drawn_sheets

holdout: setup  ## build rock from half of the sweeps, score it on the other half
	@$(PY) -m pipeline validate --holdout --out artifacts/proof/holdout.json

fuzz: setup  ## give every reader 500 broken and hostile files
	@$(PY) -m benchmarks.fuzz

random-mines: setup  ## build two hundred generated mines: do all hold?
	@$(PY) -m benchmarks.worlds.random_mines

evidence: all  ## write docs/evidence-figures.md from the targets above
	@$(PY) -m benchmarks.evidence


##@ Comparisons and timings

compare-paper: setup  ## the paper's choices beside the default
	@$(PY) -m benchmarks.comparisons.compare_paper

compare-rock: all  ## kinds of rock beside flat walls and white noise
	@$(PY) -m benchmarks.comparisons.compare_rock

rock-directions: setup  ## the default rock in drifts of other directions and widths (docs/rock-directions.md)
	@$(PY) -m benchmarks.comparisons.rock_directions

look-pictures: all  ## looks and fittings from inside a drift, and what they cost (docs/look.md)
	@$(PY) -m benchmarks.pictures.look_pictures

random-levels: setup  ## build two hundred random mines with heights: do all hold? (ARGS="--count 20")
	@$(PY) -m benchmarks.worlds.random_levels $(ARGS)

level-pictures: setup  ## mines with heights in plan and in space (docs/levels.png)
	@$(PY) -m benchmarks.pictures.level_pictures

decline-pictures: setup  ## views inside mines with heights, with their rock (docs/decline.jpg)
	@$(PY) -m benchmarks.pictures.decline_pictures

case-pictures: setup  ## mines that must come out whole: docs/cases.md, .png and .jpg (ARGS="--keep FOLDER")
	@$(PY) -m benchmarks.pictures.case_pictures $(ARGS)

drive-clip: all  ## ten seconds behind a robot, for the README (docs/drive.gif)
	@$(PY) -m benchmarks.pictures.drive_clip

compare-collision: setup  ## exact prisms, CoACD and V-HACD on the same plan
	@$(PY) -m benchmarks.comparisons.compare_collision

search-texture: setup  # search the noise for the texture scores
	@$(PY) -m benchmarks.comparisons.search_texture

bench: setup  ## time the environment against its references
	@OMP_NUM_THREADS=1 $(PY) -m benchmarks.speed.time_env

bench-heights: setup  ## time mines with heights against level ones (docs/levels-speed.md)
	@OMP_NUM_THREADS=1 $(PY) -m benchmarks.speed.time_heights $(ARGS)

bench-gpu: setup-gpu  ## time the environment on a GPU (docs/env-speed-gpu.md); exit code 3 without one
	@$(PY) -m benchmarks.speed.time_gpu $(ARGS)

bench-light: setup  ## time and size of light worlds by kilometre of drift
	@OMP_NUM_THREADS=1 $(PY) -m benchmarks.speed.light_worlds

bench-growth: setup  ## time, memory and environment of mines of 1 to 100 km: ARGS="--km 1 3 10"
	@OMP_NUM_THREADS=1 $(PY) -m benchmarks.speed.growth $(ARGS)

bench-deep: setup  ## time and memory of mines of many levels, 1 km deep: ARGS="--km 40 80 --levels 20"
	@OMP_NUM_THREADS=1 $(PY) -m benchmarks.speed.time_deep $(ARGS)

bench-pipeline: setup  # time the pipeline and each stage
	@$(PY) -m benchmarks.speed.time_pipeline

time-training: setup-baselines  # environment steps/s while PPO learns
	@$(PY) -m benchmarks.speed.time_training $(ARGS)


##@ Baselines

setup-baselines:  ## the same with Ray and torch, for training
	@sh requirements/setup.sh baselines

setup-gpu:  ## the same with MuJoCo Warp, torch and rsl-rl, for the environment on a GPU
	@sh requirements/setup.sh gpu

oracle: all  ## upper bound and driven tour of every environment
	@$(PY) -m baselines.oracle $(ARGS)

explorers: all  ## evaluate the classical explorers in every environment
	@$(PY) -m baselines.evaluate --all $(ARGS)

unseen: setup  ## bounds and classical explorers in the 200 mines of the test split; resumes
	@$(PY) -m baselines.split --bounds --policy wall-following nearest-frontier information-gain frontier-tour depth-first two-level $(ARGS)

published-plan: setup  ## policies in the world of the published plan, after `make data` (docs/published-plan.md); resumes
	@$(PY) -m benchmarks.comparisons.published_plan $(ARGS)

worst-mines: setup  ## where a learned explorer loses: ARGS="--policy graph-cool-42 --beside information-gain"
	@$(PY) -m baselines.worst_mines $(ARGS)

teams: all  ## teams of two and four robots against one: ARGS="--mines 20" (docs/team.md); resumes
	@$(PY) -m baselines.team $(ARGS)

train: setup-baselines  ## train PPO: SEED=42 ARGS="env=full observation=map"; run again to resume
	@$(PY) -m baselines.ppo.train seed=$(SEED) $(ARGS)

train-gpu: setup-gpu  ## train PPO on a GPU: SEED=42 ARGS="device=cuda:0 env=entrance"; run again to resume
	@$(PY) -m baselines.ppo.train_gpu seed=$(SEED) $(ARGS)

train-graph: setup-baselines  ## train the graph explorer in light mines (make worlds N=96 first); run again to resume
	@OMP_NUM_THREADS=1 $(PY) -m baselines.graph.training.train seed=$(SEED) $(ARGS)

compare-graph: setup  ## the graph explorer's map simulator beside the environment (docs/graph-simulator.md)
	@OMP_NUM_THREADS=1 $(PY) -m baselines.pages.simulator $(ARGS)

train-all: setup-baselines  # train with the paper's five seeds
	@for seed in 42 142 242 342 442; do $(PY) -m baselines.ppo.train seed=$$seed $(ARGS) || exit $$?; done

curves: setup  # draw the training runs (docs/training.md, docs/graph-training.md)
	@$(PY) -m baselines.ppo.curves && $(PY) -m baselines.graph.training.curves

renew-benchmark: all  ## measure all that depends on the world again: oracle, policies, leaderboard; resumes
	@$(PY) -m baselines.oracle && $(PY) -m baselines.evaluate --all && $(PY) -m baselines.leaderboard

rerun: all  ## drive the kept results again from their policies; LEADERBOARD.md then shows it
	@for file in $$($(PY) -m baselines.scoring.rerun); do $(PY) -m baselines.score $$file --rerun all || exit $$?; done
	@$(PY) -m baselines.leaderboard

leaderboard: all  ## score all results files, write LEADERBOARD.md
	@$(PY) -m baselines.leaderboard

claims: setup  ## write docs/claims.md: the paper's figures beside ours
	@$(PY) -m benchmarks.claims


##@ Project

test-slow: setup  ## run the slow tests
	@$(PY) -m pytest -m slow tests

test-train: setup-baselines  # run the tests of training
	@$(PY) -m pytest tests/baselines/ppo/test_ppo.py tests/baselines/graph/test_graph.py

test-gpu: setup-gpu  # run the tests of the environment on Warp, by Warp's CPU device where there is no GPU
	@$(PY) -m pytest tests/minexplore/warp/test_warp.py tests/baselines/ppo/test_ppo_on_warp.py

docs: setup  ## build the documentation into artifacts/site
	@$(PY) -m benchmarks.pictures.draw_styles
	@mkdocs build -q

look: all  # open the report in headless Chromium and measure it
	@$(PY) -m benchmarks.pictures.look_at_report

env-page: setup  # write docs/reference/environment.md from the environment
	@$(PY) -m minexplore page > docs/.environment.new && mv docs/.environment.new docs/reference/environment.md

wheel: setup  ## build dist/minexplore-*.whl with the default world
	@PYTHONPATH=. $(PY) packaging/build_wheel.py

sbom: setup  ## list every package with its licence (artifacts/sbom.json)
	@cyclonedx-py environment --pyproject pyproject.toml --output-reproducible -o artifacts/sbom.json .venv/bin/python

provenance: setup  ## write the world's provenance as an RO-Crate (artifacts/provenance)
	@$(PY) -m pipeline provenance

dag: setup  # write dvc.yaml from the stages' declarations
	@$(PY) -m stages > .dvc.yaml.new && mv .dvc.yaml.new dvc.yaml

lock: setup  ## renew requirements/*.txt from pyproject.toml
	@echo 'torch; python_version < "3"' | uv pip compile -q $(LOCK) --extra baselines --overrides /dev/stdin \
	  pyproject.toml --group dev -o requirements/baselines.txt
	@uv pip compile -q $(LOCK) -c requirements/baselines.txt pyproject.toml --group dev -o requirements/dev.txt
	@echo 'torch; python_version < "3"' | uv pip compile -q $(LOCK) --extra gpu --overrides /dev/stdin \
	  -c requirements/baselines.txt pyproject.toml --group dev -o requirements/gpu.txt
	@uv pip compile -q $(LOCK) --group bootstrap -o requirements/bootstrap.txt
