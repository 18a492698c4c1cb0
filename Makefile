# make race    five laps, with pictures, in runs/
# make test    lint, types and all tests
# All of it needs python3 and make only; the rest is installed in .venv, at the versions of constraints.txt.

PYTHON ?= python3
VENV ?= .venv
TRACK ?= oval
CONTROLLER ?= gap_finder
LAPS ?= 5
ARGS ?=

BIN := $(VENV)/bin
RACES := $(VENV)/.races
READY := $(VENV)/.ready
NATIVE := $(VENV)/.native
RUN := runs/$(notdir $(basename $(TRACK)))-$(shell date +%Y%m%d-%H%M%S)

.PHONY: help race native test quick unit mujoco4 sanitize fuzz lint house bench figures friction docs picture dist release clean
.DEFAULT_GOAL := help

help:
	@sed -n '/^# make/s/^# //p; /^## /s/^## //p' Makefile

CONSTRAINTS ?= constraints.txt
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
INSTALL := $(PIP) install -c $(CONSTRAINTS)

# Installs what the build needs, and then what follows. A compiler that had to be installed for it is removed again.
BUILD := needed=$$($(BIN)/python native/build_backend.py) || exit 1; $(INSTALL) --no-deps --no-compile $$needed && \
    trap 'case "$$needed" in *ziglang*) $(PIP) uninstall --yes ziglang ;; esac' EXIT && $(INSTALL) --no-build-isolation

# What a race needs, with its report and picture; nothing is compiled before it is imported.
$(RACES): pyproject.toml $(CONSTRAINTS)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
	    || { echo "$(PYTHON) is too old or missing; needed: Python 3.10 or newer" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
	    || { echo "Python's venv is missing; to install it: sudo apt-get install python3-venv" >&2; exit 1; }
	@echo "installing what a race needs in $(VENV), and compiling the native core, once: about a minute"
	@$(PYTHON) -m venv $(VENV)
	@$(INSTALL) --no-compile scikit-build-core nanobind \
	    || { echo "the install did not end. With a network, the same command goes on" >&2; exit 1; }
	@$(BUILD) --no-compile -e '.[plot,report]' || $(BIN)/python tools/missing.py plot,report
	@touch $@ $(NATIVE)

## make native  builds the native core again, of what has changed in native/, or for another MuJoCo
native: $(NATIVE)
$(NATIVE): $(shell find native -type f) $(wildcard $(VENV)/lib/python3*/site-packages/mujoco/include/mujoco/mujoco.h) | $(RACES)
	@test -f $@ && test -z "$$(find $^ -newer $@)" || { $(BUILD) --no-deps -e .; }
	@touch $@

# What developers need besides.
$(READY): $(RACES) | $(NATIVE)
	@echo "installing what tests need in $(VENV), once: some minutes"
	@$(INSTALL) --no-build-isolation -e '.[dev]' || $(BIN)/python tools/missing.py dev
	@touch $@

race: $(RACES) $(NATIVE)
	$(BIN)/fg-mujoco race --track $(TRACK) --controller $(CONTROLLER) --laps $(LAPS) --out $(RUN) $(ARGS)
	@echo "the picture: $(RUN)/trace.png"

test: $(READY)
	+@$(MAKE) --no-print-directory -j2 lint unit

unit: $(READY)
	$(BIN)/python -m pytest -n auto --dist loadfile $(ARGS)

## make mujoco4 the tests of the last commit on the newest MuJoCo that is accepted, in a clone, whose core is its own
mujoco4:
	@mkdir -p build && sed '/^mujoco==/d' constraints.txt > build/newest.txt
	@test -d build/mujoco4/.git || { rm -rf build/mujoco4 && git clone -q . build/mujoco4; }
	@cd build/mujoco4 && git fetch -q origin HEAD && git checkout -q --detach FETCH_HEAD
	+@$(MAKE) --no-print-directory -C build/mujoco4 CONSTRAINTS=../newest.txt unit

## make sanitize the tests of the last commit, its core built for AddressSanitizer and UndefinedBehaviorSanitizer
SANITIZED := CXXFLAGS='-fsanitize=address,undefined -fno-sanitize-recover=undefined -g1' SKBUILD_CMAKE_DEFINE='FG_LEVEL=-O1'
sanitize:
	@mkdir -p build
	@test -d build/sanitize/.git || { rm -rf build/sanitize && git clone -q . build/sanitize; }
	@cd build/sanitize && git fetch -q origin HEAD && git checkout -q --detach FETCH_HEAD
	+@$(SANITIZED) $(MAKE) --no-print-directory -C build/sanitize .venv/.ready
	@cd build/sanitize && libraries=$$(for each in libasan.so libstdc++.so; do $${CXX:-g++} -print-file-name=$$each; done) && \
	    LD_PRELOAD=$$(echo $$libraries) ASAN_OPTIONS=detect_leaks=0 .venv/bin/python -m pytest -n auto --dist loadfile $(ARGS)

## make quick   of what differs from main, the tests that are not slow; at most a minute
quick: $(READY)
	$(BIN)/python -m pytest --changed -m "not slow" -n auto --dist loadfile $(ARGS)

## make fuzz    the tests of random and hostile input, with others than in `make test`, again and again until one fails
fuzz: $(READY)
	while HYPOTHESIS_PROFILE=fuzz $(BIN)/python -m pytest -q -m hypothesis -n auto --dist loadfile $(ARGS); do :; done

## make lint    ruff, mypy, and the layers of the rooms
lint: $(READY) house
	$(BIN)/ruff check
	cd $(HOUSE) && $(abspath $(BIN))/mypy --config-file $(CURDIR)/pyproject.toml --cache-dir $(CURDIR)/.mypy_cache
	test ! -x $(BIN)/lint-imports || (cd $(HOUSE) && \
	    $(abspath $(BIN))/lint-imports --config $(CURDIR)/pyproject.toml --no-cache --no-logo)  # needs Python 3.11

# The packages as they lie once installed, so that types and imports are checked across the top-level folders.
HOUSE := build/house
house:
	@rm -rf $(HOUSE) && mkdir -p $(HOUSE)/fg_mujoco
	@ln -s $(CURDIR)/fg_mujoco/* $(foreach part,models tracks controllers addons,$(CURDIR)/$(part)) $(HOUSE)/fg_mujoco/
	@touch $(HOUSE)/fg_mujoco/_native.py  # import-linter does not see compiled modules

## make bench   how fast it is, on an idle machine; some ten minutes
bench: $(READY)
	$(BIN)/python benchmarks/all.py $(ARGS)

## make figures the races whose results README.md and docs/ show, and the tables made from them; some minutes
DATA ?= ../shared/data
figures: $(READY)
	$(BIN)/python benchmarks/circuits.py --json docs/figures.json --data $(DATA) $(ARGS)
	$(BIN)/python docs/tables.py

## make friction the friction lab, and its tables and figures in runs/friction; some minutes, less what is there
friction: $(READY)
	$(BIN)/fg-mujoco friction all --out runs/friction $(ARGS)

## make docs    the documentation as a site, in build/site
docs: $(READY)
	@$(BIN)/python -c 'import material, mkdocstrings' 2>/dev/null || $(INSTALL) \
	    --no-build-isolation -e '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict $(ARGS)
	@echo "the site: build/site/index.html"

## make picture the picture in motion of the README, and that of two laps
PICTURE := docs/images/oval_trace.png
picture: $(READY)
	folder=$$(mktemp -d) && $(BIN)/fg-mujoco race --laps 2 --out $$folder && $(BIN)/python -c \
	    "from PIL import Image; Image.open('$$folder/trace.png').convert('RGB').quantize(256).save('$(PICTURE)')" \
	    && rm -r $$folder
	$(BIN)/python docs/diagrams/race.py

## make dist    the wheel and the sdist of a release, in dist/
dist: $(READY)
	rm -rf dist
	$(PIP) wheel --no-deps --no-build-isolation -w dist .
	$(BIN)/python -c "from scikit_build_core.build import build_sdist; build_sdist('dist')" > /dev/null
	@ls dist/*

## make release VERSION=0.2.0   tests, builds, tries and tags a release; with ARGS=--dry-run all but the tag
release: $(READY)
	$(BIN)/python release.py $(VERSION) $(ARGS)

## make clean   removes everything that was made, except runs/
clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis MUJOCO_LOG.TXT
