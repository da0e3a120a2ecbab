# Carillon: `make run` for the default workflow and its report, `make test` for the tests.
# From a fresh Debian or Ubuntu machine both install what is missing first.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
MAKEFLAGS += --no-print-directory

VENV ?= .venv
PYTHON_OF_VENV = $(VENV)/bin/python
# One job of as many cores as there are, or as many as fit: Snakemake adds up the threads of its
# jobs, and every MPI rank takes its share of them (carillon.processes.threads.limit_threads).
CORES ?= all
TARGETS ?= all
PYTEST_OPTIONS ?=
# Test files run beside each other, each in one process, the long ones first. Many wait for a while, those
# of SLURM most of the time, which is what the third and fourth process are for.
PYTEST_PROCESSES ?= 4
# change: what every change needs; part: that and a part of the rest (tests/tiers.py); all: everything.
TIER ?= change
PACKAGES = $(patsubst %/__init__.py,%,$(wildcard */__init__.py))
RULES = $(wildcard Snakefile workflow/rules/*.smk studies/*/*.smk)

# Rules and tests call the tools of the environment by name.
export PATH := $(abspath $(VENV))/bin:$(PATH)
export VENV
# Open MPI refuses to start as root, the usual user of a container, unless told twice.
ifeq ($(shell id -u),0)
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
endif

# Tests start thousands of processes, which need not compile the same modules.
unexport PYTHONDONTWRITEBYTECODE
# They run beside each other, so that more threads would only wait for each other.
test: export OMP_NUM_THREADS ?= 1

.PHONY: help env run test test-all check docs release clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-8s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))
	@echo "  PETSC=source make env   build PETSc and SLEPc against the MPI on PATH instead of using apt's"

env:  ## only the environment: .venv with PETSc and SLEPc
	@bash workflow/envs/setup.sh

# Without compiled kernels the jobs and the tests compile them.
run: env  ## the default workflow; ends at results/report.html
	@$(PYTHON_OF_VENV) -m workflow compile training spectra blocks || true
	@snakemake --profile workflow/profiles/default --cores $(CORES) $(TARGETS)
	@echo "report: $(abspath results/report.html)"

test: env  ## the tests that every change needs
	@bash workflow/envs/packages.sh install tests >/dev/null || echo "tests without them are skipped"
	@$(PYTHON_OF_VENV) -m workflow compile || true
	@$(PYTHON_OF_VENV) -m pytest -q -n $(PYTEST_PROCESSES) --dist loadfile \
		--no-loadscope-reorder --tier $(TIER) $(PYTEST_OPTIONS)

test-all:  ## all tests, an hour or so, the documentation, and a clean root where one can be made
	@bash workflow/envs/packages.sh install faust >/dev/null || echo "tests without it are skipped"
	@$(MAKE) test TIER=all
	@$(MAKE) docs
	@.ci/bare-root --reuse || { status=$$?; [ $$status -eq 77 ] || exit $$status; }

check: env  ## lint, formatting, types (of the page, too), Snakemake rules
	@ruff check --quiet
	@ruff format --check --quiet || { ruff format --diff --quiet; exit 1; }
	@mypy $(PACKAGES)
	@.ci/page/check
	@if [ -n "$(RULES)" ]; then snakefmt --check $(RULES); python .ci/lint_rules.py; fi

# All pages are read anew: they depend on sources that Sphinx does not know of, and a warning would
# else be given once alone.
docs: env  ## the documentation; ends at build/docs/index.html
	@bash workflow/envs/docs.sh build/docs-venv
	@build/docs-venv/bin/python -m sphinx -q -E -W --keep-going -d build/doctrees docs build/docs
	@echo "documentation: $(abspath build/docs/index.html)"

release: docs  ## sdist, wheel, documentation, reference tables, checksums; end in build/release
	@.ci/release

clean:  ## remove the environment, caches and built files; results/ stays
	@rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache *.egg-info
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
