# Each target sets everything up by itself: all it needs is GNU make and a Python of at least 3.11.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready

PAPERS := $(patsubst papers_repro/%/reproduce.py,reproduce-%,$(wildcard papers_repro/*/reproduce.py))

# What one command has compiled the next ones load (altijax.keep_programs).
export ALTIJAX_KEEP_PROGRAMS ?= 1
# Lines come as they are printed.
export PYTHONUNBUFFERED := 1

PYTEST := $(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder

.PHONY: reproduce $(PAPERS) test test-slow test-all lint lab notebooks constraints clean

reproduce: $(PAPERS)  ## every paper's table beside ours, and real drives where ALTIJAX_DATA_DIR holds them

$(PAPERS): reproduce-%: $(READY)
	@TQDM_DISABLE=1 $(BIN)/python -m papers_repro $*

test: $(READY)  ## what runs before each commit
	$(PYTEST) -m "not slow"

test-slow: $(READY)  ## what `make test` leaves out: notebooks, papers in small, searches
	$(PYTEST) -m slow

test-all: $(READY)  ## all tests
	$(PYTEST)

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

lab: $(READY)  ## JupyterLab at the quickstart
	$(BIN)/jupyter lab notebooks/00_quickstart.ipynb

notebooks: $(READY)  ## execute every notebook and store its pictures
	$(BIN)/python notebooks/execute.py

# No index address and no local path may get into the file, so uv's own lock is not used (CONTRIBUTING.md).
constraints: $(READY)
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile pyproject.toml --python-version 3.11 --universal --all-extras --no-annotate --no-header \
	    --upgrade --quiet --output-file constraints.txt

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and \
	    "AltiJAX needs Python 3.11 or newer, $(PYTHON) is " + sys.version.split()[0] + ": make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
	    --editable '.[dev,export,lab,logs,mdf,ros]'
	@touch $(READY)

clean:
	rm -rf $(VENV) results
