# make help lists what there is. tools/setup.sh does nothing when nothing has changed.
.DEFAULT_GOAL := help
.PHONY: help setup setup-test setup-slurm run test test-kills fuzz lint study bench docs figures-of-docs wheel sanitize check-package clean lock
SHELL := /bin/bash
# Byte code is kept, or each process compiles all that it imports: a second or two of CPU.
unexport PYTHONDONTWRITEBYTECODE
bin := .venv/bin
# Extra arguments for pytest, as in: make test ARGS='-k loop'
ARGS :=
# Processes that run tests, one of which mostly waits for ranks and jobs; a module's tests stay together.
JOBS := 3
CAMPAIGN := jobs/example.toml
FOR := 600

help:  ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-15s %s\n", $$1, $$2 }' Makefile

setup:  ## everything that adhesis needs, into .venv (ADHESIS_APT=no: no system packages)
	@tools/setup.sh

setup-test:
	@tools/setup.sh --test

setup-slurm:
	@tools/setup.sh --slurm

run: setup  ## the example campaign on all cores, then its report (CAMPAIGN=file.toml for another)
	@jobs/local.sh $(CAMPAIGN)

lint: setup-test  ## ruff, mypy and the contracts of imports
	$(bin)/ruff check .
	$(bin)/ruff format --check .
	$(bin)/mypy
	$(bin)/lint-imports --no-cache --no-logo

test: setup-slurm  ## the whole test suite, with MPI, Slurm and a browser where they can be installed
	@. tools/mpi.sh && choose_mpirun . && if [ -n "$$MPIRUN" ]; then allow_ranks 2 1; fi && \
	    export MPIRUN && exec $(bin)/python -m pytest -rs -n $(JOBS) --dist loadscope --no-loadscope-reorder $(ARGS)

test-kills: setup-test  ## 20 kills each of a worker, of rank 0 and of the whole job (about 4 minutes)
	@. tools/mpi.sh && choose_mpirun . && if [ -n "$$MPIRUN" ]; then allow_ranks 2 1; fi && \
	    export MPIRUN && exec $(bin)/python -m pytest --slow tests/ensemble/test_mpi.py -k random_moments

fuzz: setup-test  ## new examples from a seed that is printed, for FOR=600 seconds
	@$(bin)/python tools/fuzz.py --seconds $(FOR)

study: setup-test  ## tables and figures of the study from its data, and its tests (minutes)
	$(bin)/python -m study page
	$(bin)/python -m pytest study

bench: setup  ## speed against error of each method
	$(bin)/adhesis bench

docs: setup  ## the documentation site in docs/_build, its examples run
	@tools/docs.sh

wheel: setup  ## a wheel of this system and Python in dist/, for machines without a compiler
	$(bin)/python -m pip wheel --no-deps --no-build-isolation --wheel-dir dist .

sanitize: setup-test  ## tests of the kernels with bounds, addresses and arithmetic checked
	@tools/sanitize.sh

check-package: setup  ## wheel and source distribution, used in a bare environment
	@tools/check_package.sh

figures-of-docs: setup  ## every figure of README and docs, by its command, stamped (an hour)
	$(bin)/python tools/figures_of_docs.py $(ARGS)

lock: setup-test  ## both lists of versions, from .venv
	$(bin)/python tools/lock.py

clean:  ## removes .venv, caches and the example's results; built wheels stay in .setup
	rm -rf .venv .pytest_cache .mypy_cache .ruff_cache .hypothesis build *.egg-info \
	    out/example out/example.h5 docs/_build docs/gallery
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
