# Everything here sets itself up: the first target builds .venv with what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PARAMREDUCE := $(BIN)/paramreduce
JOBS ?= $(shell nproc 2>/dev/null || echo 1)

# The paper's two systems; and small cases of seconds, for trying things out.
PAPER := puma560 hexaglide
MEASURED := tx40 ur10 panda
SMALL := two_link four_bar five_bar rssr delta humanoid_leg cart_pole quarter_car puma560_friction

.PHONY: docs serve help all campaign $(PAPER) $(PAPER:%=%-terms) $(SMALL) $(MEASURED) test check format sweep test-cluster test-pythons regression optimiser reference benchmark robots identification controllers parts widths learning pages torture graph clean
.DEFAULT_GOAL := help

help:
	@echo "make puma560     run the whole pipeline on the PUMA 560"
	@echo "make hexaglide   the same on the 6-PUS Hexaglide, in a few minutes"
	@echo "make puma560-terms   the same with the whole search for negligible terms, a minute more; also hexaglide-terms"
	@echo "make all         both, and one table over them"
	@echo "make two_link    a small arm, in seconds; also four_bar, five_bar, rssr, delta"
	@echo "make ur10        identify and reduce from a recording of the robot; also panda, tx40"
	@echo "make sweep       all runs of pipelines/sweep.yaml; PROFILE=slurm on a cluster"
	@echo "make test-cluster    sweeps here and on a Slurm of its own, with kills, against plain runs"
	@echo "make test        run the tests"
	@echo "make check       lint, format and types"
	@echo "make regression  compare with the committed references; make optimiser does so with freshly optimised trajectories"
	@echo "make campaign    all that takes too long for every change: an hour and more"
	@echo "make reference   renew the committed references"
	@echo "make benchmark   measure speed, as ratios, and CPU seconds; BEFORE=REVISION compares the stages with it"
	@echo "make robots      arms from their URDF to code: sizes, operations, nanoseconds"
	@echo "make pages       reports in a browser: sizes and times"
	@echo "make identification  intervals and hints on simulated logs"
	@echo "make controllers     rest-to-rest trajectories of two arms, checked"
	@echo "make parts       parts of the dynamics beside urdf2casadi's and Pinocchio's"
	@echo "make widths      exported C by width of the processor's vectors"
	@echo "make learning    JAX and PyTorch modules beside MuJoCo MJX and adam-robotics"
	@echo "make docs        build the site, and run what it tells to type"
	@echo "make serve       the site, to read in a browser"
	@echo "make test-pythons  the small case with every other Python from 3.11 to 3.13"
	@echo "make torture     damage files and kill runs, and see that nothing is lost"
	@echo "make results/ROBOT/FILE.h5   just what is missing for that file"

# Wheels hold some libraries three times, as they cannot hold links; an eighth of the environment is copies.
SMALLER = ! command -v hardlink >/dev/null || hardlink --quiet --ignore-time --minimum-size 20k $(VENV)

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable .
	@$(SMALLER)
	-@$(BIN)/paramreduce doctor
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@$(SMALLER)
	@touch $@

# Exported modules for JAX and PyTorch are tested where these are installed.
$(VENV)/.installed-learning: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[learning]'
	@$(SMALLER)
	@touch $@

$(PARAMREDUCE): $(VENV)/.installed

$(PAPER) $(SMALL): $(VENV)/.installed
	@$(PARAMREDUCE) run configs/$@.yaml --jobs $(JOBS)

# The search for negligible terms ends after some seconds in these configs; here it ends by itself.
WHOLE_SEARCH := --set terms.time_limit=null

$(PAPER:%=%-terms): %-terms: $(VENV)/.installed
	@$(PARAMREDUCE) run configs/$*.yaml --jobs $(JOBS) $(WHOLE_SEARCH)

# Physical consistency needs a solver of its own.
$(VENV)/.installed-identify: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[identify]'
	@touch $@

$(MEASURED): $(VENV)/.installed-identify
	@$(PARAMREDUCE) run configs/$@.yaml --jobs $(JOBS)

# Workflows over many runs are Snakemake's.
$(VENV)/.installed-sweep: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[sweep]'
	@touch $@

# What pipelines/sweep.yaml lists; SWEEP=FILE another list, PROFILE=slurm on a cluster.
SWEEP ?= pipelines/sweep.yaml
PROFILE ?= local

sweep: $(VENV)/.installed-sweep
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/snakemake --snakefile pipelines/Snakefile --quiet rules \
	  --profile pipelines/profiles/$(PROFILE) --config sweep=$(SWEEP)

# Everything takes more than an hour, CLUSTER="--robots 1 --seeds 3" half of one; with Debian's
# slurm-wlm and munge, and as root, on a Slurm of its own too.
CLUSTER ?=

test-cluster: $(VENV)/.installed-sweep $(VENV)/.installed-dev
	PATH="$(CURDIR)/$(BIN):$$PATH" PYTHONPATH=tests $(BIN)/python -m tests.cluster $(CLUSTER)

all: $(PAPER)
	@$(PARAMREDUCE) table $(PAPER:%=results/%)

test: $(VENV)/.installed-dev
	$(BIN)/pytest -n $(JOBS) --dist worksteal

check: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/.installed-dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# Everything after the optimiser is repeated from the committed coefficients and must agree, proofs
# as far as they come in ten seconds.
REFERENCES := $(patsubst results/reference/%.json,%,$(wildcard results/reference/*.json))
whole_search = $(if $(filter $*,$(PAPER)),$(WHOLE_SEARCH))

regression: $(VENV)/.installed $(REFERENCES:%=regression-%)

regression-%: $(VENV)/.installed
	rm -rf results/regression/$*
	$(PARAMREDUCE) run configs/$*.yaml --results results/regression/$* --quiet --jobs $(JOBS) \
	  --set reduction.best_subset.time_limit=10 $(whole_search) \
	  --set trajectories.file=$(CURDIR)/results/reference/$*.json
	$(PARAMREDUCE) compare results/reference/$*.json results/regression/$*

# The optimiser is random, and so gated by the condition numbers that it reaches; fewer trajectories, such as
# OPTIMISER="--set trajectories.count=4", spread more and need a larger TOLERANCE.
OPTIMISER ?=
TOLERANCE ?= 0.1

optimiser: $(VENV)/.installed $(REFERENCES:%=optimiser-%)

optimiser-%: $(VENV)/.installed
	rm -rf results/regression/$*-optimised
	$(PARAMREDUCE) run configs/$*.yaml --results results/regression/$*-optimised --quiet \
	  --jobs $(JOBS) --set reduction.heuristics=[forward-selection] \
	  --set validation.stability=false --set validation.accept={} --set terms=null \
	  --set trajectories.test_count=0 --set trajectories.test_point_to_point_count=0 $(OPTIMISER)
	$(PARAMREDUCE) compare results/reference/$*.json results/regression/$*-optimised --only kappa \
	  --tolerance kappa=$(TOLERANCE)

reference: $(REFERENCES:%=reference-%)

reference-%: $(VENV)/.installed
	$(PARAMREDUCE) run configs/$*.yaml --jobs $(JOBS) $(whole_search)
	cp results/$*/report/summary.json results/reference/$*.json

# What takes too long for every change; docs/soundness.md says when it last ran and what came out.
campaign: regression optimiser docs test-pythons
	$(MAKE) torture
	$(MAKE) test-cluster

benchmark robots identification controllers parts widths pages: export PYTHONPATH := tests
benchmark: $(VENV)/.installed-dev
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev,benchmark]'
	$(BIN)/python -m tests.benchmarks
	$(BIN)/python -m tests.benchmarks.budgets
	$(if $(BEFORE),$(BIN)/python -m tests.benchmarks.revisions $(BEFORE))

# Arms that people have, from their URDF to code: sizes, operations and times in results/robots.
robots: $(VENV)/.installed-dev
	$(BIN)/python -m tests.benchmarks.robots

# How large pages are, how soon they can be used, and what a step of their slider takes.
pages: $(VENV)/.installed-dev
	$(BIN)/python -m tests.benchmarks.page $(patsubst %/report/index.html,%,$(wildcard results/*/report/index.html))

# How often intervals hold the truth and hints are right, on hundreds of simulated logs.
identification: $(VENV)/.installed-dev
	$(BIN)/python -m tests.benchmarks.identification

# Rest-to-rest trajectories of two arms against limits of torque and distance.
controllers: $(VENV)/.installed-dev
	$(BIN)/python -m tests.benchmarks.controllers

# urdf2casadi asks for a CasADi of 2020, but runs with today's.
parts: $(VENV)/.installed-dev
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev,benchmark]'
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps 'urdf2casadi==1.2.0' 'urdf-parser-py==0.0.4'
	$(BIN)/python -m tests.benchmarks.dynamics_parts

widths: $(VENV)/.installed-dev
	$(BIN)/python -m tests.benchmarks.vector_widths

# adam-robotics asks for an older JAX, which MJX is faster with too.
PEERS := .venv-peers
learning: $(VENV)/.installed
	$(PYTHON) -m venv $(PEERS)
	$(PEERS)/bin/pip install --quiet --disable-pip-version-check 'torch>=2.4,<2.14'
	$(PEERS)/bin/pip install --quiet --disable-pip-version-check --editable '.[learning]' 'adam-robotics[jax,pytorch]==0.5.0' 'mujoco-mjx==3.17.0' 'example-robot-data>=6,<7'
	$(PEERS)/bin/python -m tests.benchmarks.learning

# The site into site/, with warnings as errors; then every command and snippet of the tutorial and its
# neighbours from a wheel in an empty folder, also for another interpreter: DOCS="--python python3.13".
$(VENV)/.installed-docs: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

docs: $(VENV)/.installed-docs
	NO_MKDOCS_2_WARNING=1 DISABLE_MKDOCS_2_WARNING=true $(BIN)/mkdocs build --quiet
	PYTHONPATH=tests $(BIN)/python -m tests.docs $(DOCS)

# From a wheel, against the committed reference; those that are not here are not tried.
test-pythons: $(VENV)/.installed
	$(BIN)/python -m tests.pythons

# The site at http://localhost:8000.
serve: $(VENV)/.installed-docs
	NO_MKDOCS_2_WARNING=1 DISABLE_MKDOCS_2_WARNING=true $(BIN)/mkdocs serve

# Damage, kills, odd configs and full disks by the thousand; SHARE=0.01 is a minute of it.
SHARE ?= 1
torture: $(VENV)/.installed-dev
	$(BIN)/python -m tests.torture --share $(SHARE)

graph: $(VENV)/.installed
	$(PARAMREDUCE) graph --format make > pipelines/stages.mk

clean:
	rm -rf $(VENV) $(PAPER:%=results/%) $(SMALL:%=results/%) $(MEASURED:%=results/%) results/regression

PARAMREDUCE_READY := $(VENV)/.installed
include pipelines/stages.mk
