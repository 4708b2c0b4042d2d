# Thin aliases; `dvc.yaml` is the pipeline. `make all OVERRIDES="survey=plan contours.tolerance_m=0.3"` changes a run.
SHELL := /bin/sh
export PATH := $(CURDIR)/.venv/bin:$(PATH)
export OVERRIDES ?=
SEED ?= 42
N ?= 10
SPLIT ?= train
PY := .venv/bin/python
LOCK := --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header
STAGES := survey contours compile3d surface realism validation

.DEFAULT_GOAL := help
.PHONY: help setup setup-baselines all test test-slow check report verify data dag accept lock clean bench compare-collision compare-paper search-texture roughness bench-pipeline worlds random-mines look docs fuzz pushes mutants parity replay holdout evidence wheel env-page oracle explorers test-train train train-all time-training curves leaderboard claims $(STAGES)

help:            ## show this list
	@sed -n 's/^\([a-z-]*\):.*## /  \1\t/p' Makefile | expand -t 22
	@echo '  $(STAGES)' | sed 's/ /, /g; s/^, , /  /'
	@echo '                      up to and including one stage; add OVERRIDES="group=choice section.key=value"'

setup:           ## make .venv from the lock, install missing system libraries; silent when done
	@sh requirements/setup.sh dev

setup-baselines: ## the same with Ray and torch, for training
	@sh requirements/setup.sh baselines

all: setup       ## the whole pipeline (dvc repro)
	@$(PY) -m pipeline set-overrides
	@dvc repro

$(STAGES): setup
	@$(PY) -m pipeline set-overrides
	@dvc repro $@

test: setup      ## all tests but the slow ones
	@$(PY) -m pytest -n 2 -m "not slow" tests

test-slow: setup ## the slow tests
	@$(PY) -m pytest -m slow tests

check: setup     ## lint, types, import contracts, dvc.yaml up to date
	@ruff check . && ruff format --check . && mypy && lint-imports && $(PY) -m stages | cmp - dvc.yaml

report: all      ## the report page is artifacts/report/report.html; write docs/results.md from the same figures
	@$(PY) -m pipeline table

verify: setup    ## walk the manifests from the survey to the world
	@$(PY) -m pipeline verify

data: setup      ## fetch the published plan and sweeps into data/raw (MIRROR=address-or-folder to take them from)
	@$(PY) -m pipeline.survey.fetch $(if $(MIRROR),--mirror "$(MIRROR)")

compare-collision: setup  ## exact prisms, CoACD and V-HACD side by side on the same plan
	@$(PY) -m benchmarks.compare_collision

compare-paper: setup      ## the paper's preset beside the default
	@$(PY) -m benchmarks.compare_paper

search-texture: setup     ## search the overlay's noise for the texture scores: the trade-off behind the default
	@$(PY) -m benchmarks.search_texture

roughness: setup          ## measure the sweeps below data/raw again (`make data` fetches them)
	@$(PY) -m pipeline roughness data/raw/sweep_*.csv --out data/chilean_mine/roughness.json

worlds: setup    ## a family of generated mines: N=50 SPLIT=train (validation, test); ARGS="--of NAME" for variants of one
	@$(PY) -m pipeline worlds --count $(N) --split $(SPLIT) $(ARGS)

pushes: all      ## throw robots at the walls of the present world: a million contacts (artifacts/proof/certificate.json)
	@$(PY) -m pipeline certify --bundle artifacts/realism/world --contacts 1000000 --out artifacts/proof/certificate.json

test-train: setup-baselines  ## the tests of training, which need Ray and torch
	@$(PY) -m pytest tests/baselines/test_ppo.py

random-mines: setup  ## two hundred generated mines to worlds: do all hold? (docs/random-mines.md)
	@$(PY) -m benchmarks.random_mines

look: all        ## open the report in headless Chromium: size, load time, console, pictures (docs/report.png)
	@$(PY) -m benchmarks.look_at_report

docs: setup      ## build the documentation into artifacts/site
	@$(PY) -m benchmarks.draw_styles
	@mkdocs build -q

fuzz: setup      ## throw 500 broken and hostile files at every reader (docs/fuzz.md)
	@$(PY) -m benchmarks.fuzz

mutants: all     ## inject faults into the present world; the validator must catch each (artifacts/validation/mutants.json)
	@$(PY) -m benchmarks.mutants

parity: all      ## cast the same rays by every backend (artifacts/proof/parity.json)
	@$(PY) -m pipeline parity --bundle artifacts/realism/world --out artifacts/proof/parity.json

replay: all      ## replay the sweeps below data/raw in the present world (artifacts/proof/replay.json and .png)
	@$(PY) -m pipeline replay --bundle artifacts/realism/world --sweeps data/raw --poses data/raw/scan_poses.csv --out artifacts/proof

holdout: setup   ## build rock from half of the sweeps below data/raw, score it on the other half
	@$(PY) -m pipeline validate --holdout --out artifacts/proof/holdout.json

evidence: all    ## write docs/evidence-figures.md: the published plan's replay (after `make data`) and what the targets above found
	@$(PY) -m benchmarks.evidence

oracle: all      ## upper bound and driven tour of every environment (baselines/results/bounds.json, docs/oracle-*.png)
	@$(PY) -m baselines.oracle

explorers: all   ## evaluate the classical explorers in every environment (baselines/results)
	@$(PY) -m baselines.evaluate --all

train: setup-baselines  ## train PPO: SEED=42, more by ARGS="env=full observation=map"; run it again to go on
	@$(PY) -m baselines.ppo.train seed=$(SEED) $(ARGS)

train-all: setup-baselines  ## the paper's five seeds, one after another
	@for seed in 42 142 242 342 442; do $(PY) -m baselines.ppo.train seed=$$seed $(ARGS) || exit $$?; done

time-training: setup-baselines  ## environment steps/s with PPO's updates (artifacts/bench/training.json); close other programs
	@$(PY) -m benchmarks.time_training $(ARGS)

curves: setup    ## draw the training runs and tabulate them beside the paper's (docs/training.md)
	@$(PY) -m baselines.ppo.curves

leaderboard: all ## score all results files and write LEADERBOARD.md
	@$(PY) -m baselines.leaderboard

claims: setup    ## write docs/claims.md: every figure of the paper beside what is measured here
	@$(PY) -m benchmarks.claims

bench: setup     ## time the environment against its references (artifacts/bench/env.json)
	@OMP_NUM_THREADS=1 $(PY) -m benchmarks.time_env

bench-pipeline: setup     ## time the pipeline and each stage in a copy of the project
	@$(PY) -m benchmarks.time_pipeline

wheel: setup     ## build dist/minexplore-*.whl with the default world inside
	@PYTHONPATH=. $(PY) packaging/build_wheel.py

env-page: setup  ## write docs/env.md from the environment's docstring
	@$(PY) -m minexplore page > docs/.env.md.new && mv docs/.env.md.new docs/env.md

accept: setup    ## accept the present metrics as the regression gate's baseline
	@$(PY) -m pipeline accept

dag: setup       ## write dvc.yaml from the stages' declarations
	@$(PY) -m stages > .dvc.yaml.new && mv .dvc.yaml.new dvc.yaml

lock: setup      ## renew requirements/*.txt from pyproject.toml
	@echo 'torch; python_version < "3"' | uv pip compile -q $(LOCK) --extra baselines --overrides /dev/stdin \
	  pyproject.toml --group dev -o requirements/baselines.txt
	@uv pip compile -q $(LOCK) -c requirements/baselines.txt pyproject.toml --group dev -o requirements/dev.txt
	@uv pip compile -q $(LOCK) --group bootstrap -o requirements/bootstrap.txt

clean:           ## remove artifacts and caches, keep .venv, data and the metrics that git tracks
	@find artifacts ! -type d ! -path artifacts/.gitignore ! -path artifacts/validation/metrics.json -delete
	@find artifacts -mindepth 1 -type d -empty -delete
	@rm -rf .dvc/cache .dvc/tmp .pytest_cache .mypy_cache .ruff_cache .hypothesis dvc_plots
	@find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +
