# Everything runs inside .venv; nothing needs root. `make` alone lists the targets.
# Another interpreter: `make clean setup PYTHON=python3.12`. Package index and proxy: pip's own settings and PIP_* variables.

VENV := .venv
comma := ,
BIN := $(VENV)/bin
# what a run needs; what development needs besides
RUNS := $(VENV)/.runs
READY := $(VENV)/.ready
PYTHON ?=
CANDIDATES = $(if $(PYTHON),$(PYTHON),python3.13 python3.12 python3.11 python3)
SUITABLE := import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))
# what runs on a robot's computer, with Python 3.10 as well
ALONE := optopad.fabrication.driver optopad.fabrication.stage optopad.sims.learning.inference
DEMO := piacenza2017-pad
# Files of tests side by side; 1 for one after another.
WORKERS ?= 2
SIDE_BY_SIDE = $(if $(filter 1,$(WORKERS)),,-n $(WORKERS) --dist loadfile)
# Thousands of small folders are made and removed: in memory where that can be.
IN_MEMORY = $(if $(wildcard /dev/shm/.),PYTEST_DEBUG_TEMPROOT=/dev/shm)
# The seconds of every test go to build/; `make durations` shows the costliest files.
PYTEST = $(IN_MEMORY) $(BIN)/python -m pytest -q --durations-file=build/durations-$@.txt
DURATIONS = $(wildcard build/durations-*.txt)

# Without compiled files beside the sources every start takes seconds longer.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup demo studio test test-slow test-full test-all durations lint docs bench bench-smoke validate release-check pins clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1|/p' Makefile | awk -F'|' '{printf "  make %-11s %s\n", $$1, $$2}'

setup: $(READY) ## create .venv and install optopad with everything it needs

demo: $(RUNS) ## the main job on the published pad: outputs/piacenza2017-pad-<digest8>/
	$(BIN)/optopad run $(DEMO)

studio: $(RUNS) ## the published pad live in a browser, on this machine alone
	$(BIN)/optopad studio $(DEMO)

test: setup ## what a change breaks first; three to four minutes on two cores
	$(PYTEST) -m "not slow and not full" --benchmark-skip $(SIDE_BY_SIDE)

test-slow: setup ## tests that take longer, in every CI run
	$(PYTEST) -m "slow and not full" --benchmark-skip $(SIDE_BY_SIDE)

test-full: setup ## databases, clusters, the full fuzz, all pages of docs run whole, reduced validation
	$(PYTEST) -m full --benchmark-skip $(SIDE_BY_SIDE)

test-all: test test-slow test-full bench-smoke ## all of these and every benchmark once; before a release

durations: ## the costliest test files of the last runs
	@$(if $(DURATIONS),$(BIN)/python -m tests.durations $(DURATIONS),echo "no durations yet: run make test")

lint: setup ## style, format, types, the arrows between the rooms, and unclear words as warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --python-version 3.10 --no-warn-return-any $(patsubst %,-p %,$(ALONE))
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m tests.plain_words

docs: setup ## the pages of docs/ as a site: build/docs/index.html; a link that leads nowhere is an error
	$(BIN)/python -m sphinx -q -W --keep-going -n -b html -d build/docs-doctrees docs build/docs

bench: setup ## the benchmarks only
	$(BIN)/python -m pytest --benchmark-only

bench-smoke: setup ## every benchmark once at its smallest size, to see that it runs; its times mean nothing
	$(BIN)/python -m pytest --benchmark-disable tests/bench $(SIDE_BY_SIDE)

validate: setup ## the figures of docs/validation, made anew (hours; interrupted, it goes on where it stopped)
	$(BIN)/python -m tests.validation.contact.contact_reference
	$(BIN)/python -m tests.validation.contact.contact_table
	$(BIN)/python -m tests.validation.contact.library_interpolation
	$(BIN)/python -m tests.validation.contact.crown.crown_reference
	$(BIN)/python -m tests.validation.contact.crown.crown_table
	$(BIN)/python -m tests.validation.contact.pad_oracle
	$(BIN)/python -m tests.validation.contact.pad_table
	$(BIN)/python -m tests.validation.held.truth
	$(BIN)/python -m tests.validation.held.object_table
	$(BIN)/python -m tests.validation.held.tips_truth
	$(BIN)/python -m tests.validation.held.tips_table
	$(BIN)/python -m tests.validation.scene.contact_table
	$(BIN)/python -m optopad scene piacenza2017-pad --fit --out build/scene
	$(BIN)/python -m tests.validation.scene.light_table
	$(BIN)/python -m tests.validation.light.light_reference_build
	$(BIN)/python -m tests.validation.light.light_table
	$(BIN)/python -m tests.validation.light.light_pad
	$(BIN)/python -m tests.validation.light.shapes_table
	$(BIN)/python -m tests.validation.light.tips_table
	$(BIN)/python -m tests.validation.light.floor_table
	$(BIN)/python -m tests.validation.light.vcnl_table
	$(BIN)/python -m tests.validation.light.light_oracle
	$(BIN)/python -m tests.validation.light.crossing_light
	$(BIN)/python -m tests.validation.light.light_walk
	$(BIN)/python -m tests.validation.light.light_speed
	$(BIN)/python -m tests.validation.learning.press_curve_table
	$(BIN)/python -m tests.validation.verdict.search_table
	$(BIN)/python -m tests.validation.verdict.thickness
	$(BIN)/python -m tests.validation.driver.link_table
	$(BIN)/python -m tests.validation.driver.slip_table
	$(BIN)/python -m tests.validation.learning.signal_map_table
	$(BIN)/python -m tests.validation.learning.hidden_builds
	$(BIN)/python -m tests.validation.driver.firmware_rates
	$(BIN)/python -m tests.validation.learning.learning_speed
	$(BIN)/python -m tests.validation.learning.touch_choice
	$(BIN)/python -m tests.validation.learning.memory_table
	$(BIN)/python -m tests.validation.learning.two_touches_table
	$(BIN)/python -m tests.validation.learning.reality_check
	$(BIN)/python -m tests.validation.learning.true_touch
	$(BIN)/python -m tests.validation.verdict.heights
	$(BIN)/python -m tests.validation.verdict.presets_table
	$(BIN)/python -m tests.validation.figures

release-check: setup ## wheel and source distribution: built, checked, installed, and run outside the checkout
	rm -rf build/dist build/release
	$(BIN)/python -m hatchling build -d build/dist
	$(BIN)/python -m venv build/release && build/release/bin/python -m pip install -q "twine>=6"
	build/release/bin/twine check --strict build/dist/*
	build/release/bin/python -m pip install -q -c constraints.txt "$$(ls build/dist/*.whl)[design]"
	mkdir build/release/run && cd build/release/run && ../bin/optopad run $(DEMO)
	build/release/bin/python -m pip install -q --no-deps --force-reinstall build/dist/*.tar.gz
	cd build/release/run && ../bin/optopad check $(DEMO)

pins: ## renew constraints.txt from a fresh environment (oldest supported Python: its versions serve the newer ones)
	@$(call find_python,$(if $(PYTHON),$(PYTHON),python3.11)); \
	rm -rf build/pins && "$$python" -m venv build/pins && \
	build/pins/bin/python -m pip install -e ".[design,dev]" && \
	{ sed -n '/^#/p' constraints.txt; build/pins/bin/python -m pip freeze --exclude-editable; } > build/constraints.txt && \
	mv build/constraints.txt constraints.txt && rm -rf build/pins

clean: ## remove .venv, caches and build folders; outputs/ stays
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks .import_linter_cache *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Sets the shell variable `python` to the first of the given commands that runs, is of a supported version and has venv.
define find_python
python=; bare=; for candidate in $(1); do \
  command -v "$$candidate" >/dev/null 2>&1 && "$$candidate" -c '$(SUITABLE)' >/dev/null 2>&1 || continue; \
  if "$$candidate" -c 'import ensurepip, venv' >/dev/null 2>&1; then python="$$candidate"; break; fi; \
  bare="$$bare $$candidate"; \
done; \
if [ -z "$$python$$bare" ]; then \
  echo "optopad needs Python 3.11, 3.12 or 3.13; none of these is one: $(1)" >&2; \
  echo "Install one (Debian and Ubuntu: python3 and python3-venv; macOS: brew install python@3.13), or name yours:" >&2; \
  echo "  make setup PYTHON=/path/to/python3.12" >&2; \
  exit 1; \
fi; \
if [ -z "$$python" ]; then \
  echo "Cannot create environments:$$bare lacks the venv or ensurepip module." >&2; \
  echo "Install it (Debian and Ubuntu: apt-get install python3-venv), or name another Python: make setup PYTHON=..." >&2; \
  exit 1; \
fi
endef

# An environment that still runs is kept and brought up to date; a broken one (its Python was removed) is made anew.
define environment
@$(call find_python,$(CANDIDATES)); \
if ! $(BIN)/python -c '$(SUITABLE)' >/dev/null 2>&1 || ! $(BIN)/python -m pip --version >/dev/null 2>&1; then \
  echo "Creating $(VENV) with $$("$$python" --version)"; \
  "$$python" -m venv --clear $(VENV) || { echo "Could not create $(VENV); is the disk full or the folder read-only?" >&2; exit 1; }; \
fi
endef

# Compiling all that is installed takes longer than compiling what is imported, when it is.
define install
@$(BIN)/python -m pip install --quiet --no-compile -c constraints.txt $(1) || { \
  echo "pip could not install the dependencies; its lines above name the one. Usual causes:" >&2; \
  echo "  no package index in reach  set PIP_INDEX_URL or HTTPS_PROXY" >&2; \
  echo "  no wheel for this machine  optopad needs 64-bit Linux (glibc 2.31) or macOS; or try PYTHON=python3.12" >&2; \
  echo "  disk full                  .venv takes 2.5 GB" >&2; \
  exit 1; \
}
endef

# The light kernels compile beside the rest of the installation: a minute of one core, once on a machine.
$(RUNS): pyproject.toml constraints.txt
	$(environment)
	$(call install,numba numpy platformdirs pydantic scipy tomlkit)
	@PYTHONPATH=. $(BIN)/python -m optopad.sims.optics.compiling --alone </dev/null >/dev/null 2>&1 &
	$(call install,-e ".[design$(comma)studio]")
	@touch $@

$(READY): $(RUNS)
	$(call install,-e ".[design$(comma)studio$(comma)dev]")
	@touch $@
