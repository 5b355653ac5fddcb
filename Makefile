# make demo : install into .venv, film a synthetic rig and analyse the film
# make test : everything that checks the project
# make docs : the pages of docs/ into docs/_build/
# make dist : wheel and sdist into dist/, each tried in a new environment outside of this tree
.PHONY: demo test lint style types pytest compiled docs dist clean
.DEFAULT_GOAL := demo

VENV := .venv
BIN := $(VENV)/bin
# The first interpreter that is new enough; override with `make PYTHON=/path/to/python demo`.
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)

# Python compiles what is imported, once, and keeps it; pip would compile all that it installs, several times as much.
# Kept it has to be: the tests start hundreds of processes, and each would compile the same again.
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
unexport PYTHONDONTWRITEBYTECODE

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "torsight needs Python 3.11 or newer: install it, or name it with 'make PYTHON=...'" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)

# What is compiled needs these alone: they come first, and the rest is installed while they compile.
COMPILED_WITH := numpy scipy pandas numba av opencv-contrib-python-headless threadpoolctl filelock tomli-w
REQUIREMENTS = import re, sys, tomllib; \
	every = tomllib.load(open("pyproject.toml", "rb"))["project"]["dependencies"]; \
	print(*(one for one in every if re.match("[a-z-]+", one)[0] in sys.argv[1:]))

$(VENV)/.compiling: pyproject.toml | $(BIN)/python
	$(PIP_INSTALL) $$($(BIN)/python -c '$(REQUIREMENTS)' $(COMPILED_WITH))
	touch $@

$(VENV)/.installed: pyproject.toml | $(VENV)/.compiling
	$(PIP_INSTALL) --editable .
	touch $@

$(VENV)/.installed-%: pyproject.toml | $(VENV)/.compiling
	$(PIP_INSTALL) --editable ".[$*]"
	touch $@ $(VENV)/.installed

demo: $(VENV)/.installed
	$(BIN)/torsight demo --out demo

lint: style types

style: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

types: $(VENV)/.installed-dev
	$(BIN)/mypy

compiled: $(VENV)/.compiling
	$(BIN)/python tests/compile_ahead.py

pytest: $(VENV)/.installed-dev | compiled
	$(BIN)/python -m pytest

# Style and types are checked while code is compiled, and while tests wait for browsers, pipes and processes.
test:
	$(MAKE) --no-print-directory -j 2 style types pytest

docs: $(VENV)/.installed-docs
	$(BIN)/python -m sphinx -W --keep-going -q docs docs/_build
	@echo "docs/_build/index.html"

dist: $(VENV)/.installed-dev
	rm -rf dist
	$(BIN)/python -m build --outdir dist .
	$(BIN)/python fixtures/try_install.py dist/*.whl
	$(BIN)/python fixtures/try_install.py dist/*.tar.gz

clean:
	rm -rf docs/_build docs/jupyter_execute demo build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
