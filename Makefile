# landtool. `make help` lists the targets. Needs python3 (3.11 or newer) with venv; everything else goes into .venv.

PYTHON ?= python3
# Training needs torch; without it its tests are skipped. The build depends on the machine (pytorch.org/get-started):
# make test TORCH=torch==2.13.0
TORCH ?=
VENV := .venv
BIN := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DELETE_ON_ERROR:
.PHONY: help demo test test-full lint gate docs bench fixtures model clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1\t\2/p' $(MAKEFILE_LIST) | expand -t 12

demo: $(VENV)/.installed ## track the shipped clip and say what came out
	$(BIN)/python tools/demo.py

test: $(VENV)/.installed-dev ## run the tests
	$(BIN)/python -m pytest

test-full: $(VENV)/.installed-dev ## run the tests, the exhaustive ones too
	$(BIN)/python -m pytest -m "full or not full"

lint: $(VENV)/.installed-dev ## check format, style, types and the direction of imports
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

gate: $(VENV)/.installed-dev ## score every stage on datasets/fixtures against the kept baseline
	$(BIN)/landtool eval --dataset datasets/fixtures --split all --baseline datasets/baseline.json \
	    -o runs/gate --overwrite

docs: $(VENV)/.installed-dev ## build the pages as a site: site/index.html
	$(BIN)/python tools/make_docs.py --check
	$(BIN)/sphinx-build -W --keep-going -q -b html docs site

bench: $(VENV)/.installed-dev ## print the tables of speed and accuracy
	$(BIN)/python -m bench

fixtures: $(VENV)/.installed-dev ## make the files in datasets/fixtures again
	$(BIN)/python tools/make_fixtures.py

model: $(VENV)/.installed-train ## train the shipped network from nothing: about two and a half hours on two cores
	$(BIN)/python tools/make_model.py $(foreach place,$(BACKGROUNDS),--backgrounds $(place))

clean: ## remove the environment, caches and builds; runs/ stays
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The project is installed once, and again when what it needs has changed.
$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable .
	@touch $@

$(VENV)/.installed-dev: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[dev]' $(if $(TORCH),'$(TORCH)')
	@touch $@ $(VENV)/.installed

# A training without a choice of build takes the one the package index has.
$(VENV)/.installed-train: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --editable '.[train]' '$(or $(TORCH),torch>=2.4)'
	@touch $@ $(VENV)/.installed

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	    echo "make: landtool needs Python 3.11 or newer as $(PYTHON); try: make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	    echo "make: $(PYTHON) lacks venv; on Debian and Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@echo "making $(VENV)"
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }
