# Thin aliases; `dvc.yaml` is the pipeline. `make all OVERRIDES="survey=plan contours.tolerance_m=0.3"` changes a run.
SHELL := /bin/sh
export PATH := $(CURDIR)/.venv/bin:$(PATH)
export OVERRIDES ?=
# Each of the nine processes of `make all` would compile the same 300 modules, and pytest rewrite all tests.
unexport PYTHONDONTWRITEBYTECODE
PY := .venv/bin/python
LOCK := --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header
STAGES := survey contours compile3d surface realism validation

.DEFAULT_GOAL := help
.PHONY: help $(STAGES) setup setup-baselines setup-gpu setup-witness all test test-slow check clean report data evidence corpus findings parity-gpu bench-gpu train-gpu docs wheel lock dag

# Measurements, comparisons, pictures and training are `python -m benchmarks NAME`.
help:  # show the targets, those that have a remark of two hashes
	@awk -F ':.*## ' '/^##@/ {print substr($$0, 5)} /^all:/ {printf "  %-18s %s\n", "$(firstword $(STAGES)) ...", "up to and including one stage: $(STAGES)"} /^[a-z -]+:.*## / {printf "  %-18s %s\n", $$1, $$2}' Makefile

##@ Every day

setup:  ## make .venv from the lock, install missing system packages; silent when done
	@sh requirements/setup.sh dev

setup-baselines:  ## the same with Ray and torch, for training
	@sh requirements/setup.sh baselines

setup-gpu:  ## the same with MuJoCo Warp, torch and rsl-rl, for the environment on a GPU
	@sh requirements/setup.sh gpu

setup-witness:  ## the same with programs of others that tests compare with: Therion, libsdformat, Khronos' validator, Newton
	@sh requirements/setup.sh witness

all: setup  ## run the whole pipeline (dvc repro)
	@$(PY) -m pipeline set-overrides
	@dvc repro

# Three workers fill two cores, as tests wait for processes and files; more threads of BLAS than one each would wait for each other.
test: setup  ## run the tests, without the slow ones
	@OMP_NUM_THREADS=1 $(PY) -m pytest -n 3 --dist worksteal -m "not slow"

test-slow: setup  ## run the slow tests
	@OMP_NUM_THREADS=1 $(PY) -m pytest -n 2 --dist worksteal --durations=12 -m slow

check: setup  ## lint, types, import contracts, dvc.yaml up to date
	@ruff check . && ruff format --check . && mypy && lint-imports && $(PY) -m stages | cmp - dvc.yaml

clean:  ## remove what `make all` wrote and compiled modules; worlds of your own, exports and training runs stay
	@$(PY) -m pipeline clean
	@find minesurveys minexplore pipeline stages baselines benchmarks tests -path '*/__pycache__/*.pyc' -delete

# One stage and those before it: make contours OVERRIDES="contours.tolerance_m=0.15"
$(STAGES): setup
	@$(PY) -m pipeline set-overrides
	@dvc repro $@


##@ Results

report: all  ## write docs/evidence/results.md, README's table and pictures; the page is artifacts/report/report.html
	@$(PY) -m pipeline update-results

data: setup  ## fetch the published plan and sweeps into data/raw (MIRROR=address or folder)
	@$(PY) -m pipeline.survey.fetch $(if $(MIRROR),--mirror "$(MIRROR)")

# The list of what is stale, with its hours, comes before all work.
evidence: setup  ## renew the pages of docs/evidence that are older than the code, the cheapest first (ARGS="--budget 2h")
	@$(PY) -m benchmarks stale || true
	@$(MAKE) --no-print-directory all
	@$(PY) -m benchmarks evidence $(ARGS)

corpus: all  ## build artifacts/corpus, a folder of worlds that others load by name, with certificates and reports
	@$(PY) -m benchmarks corpus

parity-gpu bench-gpu train-gpu: setup-gpu  ## on a GPU: the same as the CPU does, its speed, and training (ARGS="...")
	@$(PY) -m benchmarks $@ $(ARGS)


##@ Project

# Each installs what it needs into a folder of its own; some need Debian's survex, therion or libsdformat-dev. One that
# ends before it has seen anything, as a package is missing, was not run.
findings:  ## run the scripts of findings/ and list those whose behaviour has changed
	@changed=0; for script in findings/*.sh; do \
	  if out=$$(sh $$script 2>&1); then state=holds; else \
	    changed=1; if echo "$$out" | grep -q '^seen: '; then state=CHANGED; else state='NOT RUN'; fi; fi; \
	  echo "$$(basename $$script .sh): $$state ($$(echo "$$out" | sed -n 's/^version: //p' | paste -sd, -))"; \
	done; exit $$changed

docs: setup  ## build the documentation into artifacts/site
	@$(PY) -m benchmarks.pictures.gallery styles
	@mkdocs build -q

wheel: setup  ## build dist/minexplore-*.whl with the default world (RELEASE=1: only if no page of evidence is stale)
	@$(if $(RELEASE),$(PY) -m benchmarks stale)
	@PYTHONPATH=. $(PY) packaging/build_wheel.py

dag: setup  ## write dvc.yaml from the stages' declarations
	@$(PY) -m stages > .dvc.yaml.new && mv .dvc.yaml.new dvc.yaml

lock: setup  ## renew requirements/*.txt from pyproject.toml
	@echo 'torch; python_version < "3"' | uv pip compile -q $(LOCK) --extra baselines --extra export \
	  --overrides /dev/stdin pyproject.toml --group dev -o requirements/baselines.txt
	@uv pip compile -q $(LOCK) --extra export pyproject.toml --group dev -o requirements/dev.txt
	@echo 'torch; python_version < "3"' | uv pip compile -q $(LOCK) --extra gpu --extra export \
	  --overrides /dev/stdin -c requirements/baselines.txt pyproject.toml --group dev -o requirements/gpu.txt
	@uv pip compile -q $(LOCK) --group bootstrap -o requirements/bootstrap.txt
	@uv pip compile -q $(LOCK) --group witness -o requirements/witness.txt
