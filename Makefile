# Everything here sets itself up: the first target builds .venv with what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PARAMREDUCE := $(BIN)/paramreduce
JOBS ?= $(shell nproc 2>/dev/null || echo 1)

.PHONY: help puma560 two_link test check format regression reference benchmark graph clean
.DEFAULT_GOAL := help

help:
	@echo "make puma560     run the whole pipeline on the PUMA 560"
	@echo "make two_link    the same on a small arm, in seconds"
	@echo "make test        run the tests"
	@echo "make check       lint, format and types"
	@echo "make regression  compare with the committed references"
	@echo "make reference   renew the committed references"
	@echo "make benchmark   measure speed, as ratios"
	@echo "make results/ROBOT/FILE.h5   just what is missing for that file"

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

$(PARAMREDUCE): $(VENV)/.installed

puma560 two_link: $(VENV)/.installed
	@$(PARAMREDUCE) run configs/$@.yaml --jobs $(JOBS)

test: $(VENV)/.installed-dev
	$(BIN)/pytest

check: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/.installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# Everything after the optimiser is repeated from the committed coefficients and must agree;
# the optimiser itself is gated by the condition numbers it reaches.
REFERENCES := $(patsubst results/reference/%.json,%,$(wildcard results/reference/*.json))

regression: $(VENV)/.installed $(REFERENCES:%=regression-%)

regression-%: $(VENV)/.installed
	$(PARAMREDUCE) run configs/$*.yaml --results results/regression/$* --quiet --force \
	  --set trajectories.file=$(CURDIR)/results/reference/$*.json
	$(PARAMREDUCE) compare results/reference/$*.json results/regression/$*
	$(PARAMREDUCE) run configs/$*.yaml --results results/regression/$*-optimised --quiet --force \
	  --jobs $(JOBS)
	$(PARAMREDUCE) compare results/reference/$*.json results/regression/$*-optimised --only kappa

reference: puma560 two_link
	cp results/puma560/report/summary.json results/reference/puma560.json
	cp results/two_link/report/summary.json results/reference/two_link.json

benchmark: $(VENV)/.installed-dev
	$(BIN)/python -m tests.benchmarks

graph: $(VENV)/.installed
	$(PARAMREDUCE) graph --format make > pipelines/stages.mk

clean:
	rm -rf $(VENV) results/puma560 results/two_link results/regression

PARAMREDUCE_READY := $(VENV)/.installed
include pipelines/stages.mk
