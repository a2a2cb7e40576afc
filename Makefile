# gearfmu: everything a checkout can do. `make` alone lists it.
PYTHON ?= python3
VENV   ?= .venv
RUN     = $(VENV)/bin/python
PIP     = $(RUN) -m pip install --quiet
BUILD_NEEDS = "setuptools>=77" "fmpy>=0.3.20" "plotly>=6"
STAMP   = $(VENV)/.installed
JOBS   ?= 2
PRICES  ?= phases steps effects_cost levels
OUT    ?= out
STAGES ?= $(notdir $(patsubst %/stage.toml,%,$(wildcard reduced_models/*/stage.toml)))
EVIDENCE = $(RUN) -m evidence.ledger
FAST     = $(RUN) -m pytest -n $(JOBS) --dist worksteal
TIER   ?= 1
export JOBS
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
unexport PYTHONDONTWRITEBYTECODE  # which makes every command compile all of Python's modules anew, 2 s each

help:
	@sed -n 's/^## //p' Makefile

## make demo        environment, install, clutch closure through the exported FMU; report in out/demo/report.html
demo: $(VENV)/.base
	$(RUN) -m gearfmu.cli demo --out $(OUT)/demo

## make test        gates of form (make lint), then the fast tests; what fails runs once more and shows its values
test: lint
	$(FAST) --assert=plain --durations 60 -rs || { $(FAST) --last-failed --last-failed-no-failures none; exit 1; }

## make test-full   the slow tests in six parts (PART=3: one of them); how each ended is kept in evidence/ledger.json
test-full: $(STAMP)
	$(EVIDENCE) make --again $(foreach part,$(or $(PART),1 2 3 4 5 6),test-full-$(part))

## make bench       prices on this machine, which should be idle: the tables of evidence/price and the stages' price lists
bench: $(STAMP)
	$(EVIDENCE) make --again $(PRICES)

## make stability   the hard cases: table and page
stability: $(STAMP)
	$(EVIDENCE) make --again stability

## make study       what accuracy costs: tables and charts of docs/study.md in evidence/study
study: $(STAMP)
	$(EVIDENCE) make --again study study_sets levels cost

## make evidence    stale tables, pictures and pages of README and study; TIER=2: of validation too; TARGETS="phases study"
evidence: $(STAMP)
	$(EVIDENCE) make --tier $(TIER) $(TARGETS)

## make evidence-check  lists what is stale; fails where any of it is of tier 1 (README, study)
evidence-check: $(STAMP)
	$(EVIDENCE) check

## make wheel       what a release uploads, checked: dist/*.whl with the linux64 and win64 kernels, dist/*.tar.gz
wheel: $(STAMP)
	$(RUN) -m pip install --quiet build twine
	rm -rf dist
	GEARFMU_PLATFORMS="linux64 win64" $(RUN) -m build --wheel --sdist --outdir dist
	$(RUN) -m twine check --strict dist/*

## make models      reduce all bodies of the model library again from their stage files (half an hour on two cores)
models: $(STAMP)
	for stage in $(STAGES); do $(RUN) -m gearfmu.cli reduce $$stage --force || exit 1; done

## make docs        regenerate docs/variables.md and docs/effects.md from the tables in the code
docs: $(VENV)/.base
	$(EVIDENCE) make --again pages

## make site        the documentation as a site, out/site/index.html; warnings are errors
site: $(STAMP)
	NO_MKDOCS_2_WARNING=1 $(RUN) -m mkdocs build --quiet --strict --site-dir $(abspath $(OUT))/site

## make lint        form of the sources: ruff (rules, format), mypy, clang-format
lint: $(STAMP)
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy
	git ls-files '*.c' '*.h' | xargs $(VENV)/bin/clang-format --dry-run -Werror

$(VENV)/.base: pyproject.toml setup.py
	$(PYTHON) -m venv $(VENV)
	$(PIP) --no-compile --no-deps $(BUILD_NEEDS)
	@echo "compiling the kernel beside installing packages"
	@PYTHONPATH=. $(RUN) gearfmu/kernel/build.py & kernel=$$!; \
	GEARFMU_PLATFORMS=none $(PIP) --no-compile --no-build-isolation -e . ; packages=$$?; \
	wait $$kernel && exit $$packages
	@touch $@

$(STAMP): $(VENV)/.base
	$(PIP) --no-build-isolation -e ".[test]"
	@touch $@

.PHONY: help demo test test-full bench study stability evidence evidence-check wheel models docs site lint
