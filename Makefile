# Set-up, main job, tests and docs. Each target does all that a fresh machine needs.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DOCS_STAMP := $(VENV)/.docs
AUTOPILOT_STAMP := $(VENV)/.autopilot
PYTEST_ARGS ?=
CODE := np_drake systems diagrams tests docs

# One thread a process: small matrices are slower on more, and the tests run side by side.
export OMP_NUM_THREADS := 1
export MPLBACKEND := Agg

.PHONY: venv demo test suite nightly autopilot fuzz mutants golden lint format docs clean

venv: $(STAMP)

# Without the extra `acados`: its wheel overwrites an installed casadi (docs/guide/install.md).
# torch first and by its exact version, so that nothing else pulls in another build of it.
$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt "$$(grep '^torch==' constraints.txt)"
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev,logs,mcap,challenge,cluster,exports]'
	$(BIN)/np-drake fly circle --duration 0.1 >/dev/null  # compiles the inner loops
	touch $@

demo: venv
	$(BIN)/np-drake demo --out out/demo

lint: venv
	$(BIN)/ruff check $(CODE)
	$(BIN)/ruff format --check $(CODE)
	$(BIN)/mypy

test: lint suite

suite: venv
	$(BIN)/python -m pytest -n 2 --dist loadfile $(PYTEST_ARGS)

# The long tests too.
nightly: venv
	$(BIN)/python -m pytest -n 2 --dist loadfile --nightly $(PYTEST_ARGS)

# Betaflight's firmware, built with gcc and make, and the tests that fly it.
autopilot: $(AUTOPILOT_STAMP)
	$(BIN)/python -m pytest $(PYTEST_ARGS) tests/np_drake/autopilot/test_betaflight.py tests/systems/test_betaflight.py

$(AUTOPILOT_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[autopilot]'
	touch $@

# Hostile files for every reader: FUZZ_SECONDS each.
FUZZ_SECONDS ?= 3600
fuzz: venv
	NP_DRAKE_FUZZ_SECONDS=$(FUZZ_SECONDS) $(BIN)/python -m pytest -q tests/fuzz

# Small changes of the formulas, one at a time, and whether a test notices. Minutes each; not in CI.
MUTANTS ?= --count 50 --seed 0
mutants: venv
	$(BIN)/python tests/mutants.py $(MUTANTS)

# All frozen diagnoses against their stored answers, the real flights too where NP_DRAKE_NEUROBEM names them.
golden: venv
	PYTHONPATH=. $(BIN)/python tests/golden/frozen_cases.py

format: venv
	$(BIN)/ruff check --fix $(CODE)
	$(BIN)/ruff format $(CODE)

# A broken link or anchor fails the build.
docs: $(DOCS_STAMP)
	$(BIN)/python -m mkdocs build --strict

$(DOCS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $@

clean:
	rm -rf $(VENV) build out site .pytest_cache .mypy_cache .ruff_cache .hypothesis
