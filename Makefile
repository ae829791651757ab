# Two commands: `make demo` shows the sensor running without hardware, `make test` proves it.
# Both set up .venv by themselves and need no root.

PYTHON ?= python3
TORCH  ?= torch==2.13.0
VENV   := .venv
BIN    := $(VENV)/bin
ARGS   ?=
# processes that share the tests: more than two cores, as tests of running sensors wait
JOBS   ?= 3

# distributions beside the package
BESIDE := --editable host/gellight_design --editable host/gellight_ros --editable host/gellight_scan \
    --editable host/gellight_touch

# the emulator of the firmware that others wrote
SECOND := tests/firmware/second_emulator

# Tests start hundreds of programs and a machine that emulates its processor: nothing is compiled at each start.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-all check lint types imports style pytest nightly bench boards housing docs dist lock audit clean

demo: $(VENV)/.host
	@$(BIN)/gellight demo $(ARGS)

# Every promise once: a quarter of an hour on two cores.
test: check pytest

# That, and what takes long or needs much: a virtual machine, other compilers, browsers, PyTorch, circuit boards.
test-all: test nightly

check: lint types imports style

lint: $(VENV)/.test
	$(BIN)/ruff check
	$(BIN)/ruff format --check

types: $(VENV)/.test
	$(BIN)/mypy

imports: $(VENV)/.test
	PYTHONPATH=host:host/gellight_design:host/gellight_ros:host/gellight_scan:host/gellight_touch:models:. \
	    $(BIN)/lint-imports --no-cache --no-logo

style: $(VENV)/.test
	$(BIN)/pytest -m style tests/style tests/host/cli/test_help.py

pytest: $(VENV)/.test | browser
	$(BIN)/pytest --numprocesses $(JOBS) --durations 20 $(ARGS)

nightly: $(VENV)/.dev | browser tools
	$(BIN)/pytest -m nightly --numprocesses $(JOBS) --durations 20 $(ARGS)

bench: $(VENV)/.test
	$(BIN)/python -m tests.benchmarks.frame_times $(ARGS)

# The site, in build/site: strict, so a link that leads nowhere ends it.
docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

# What is ordered and printed for a sensor, in build/boards and build/housing; ARGS: options of the verb.
boards: $(VENV)/.parts
housing: $(VENV)/.parts
boards housing:
	$(BIN)/gellight optimize make $@ --out build/$@ $(ARGS)

# What a package index takes, in dist/, and what is in it (CycloneDX).
dist: $(VENV)/.dev
	rm -rf dist
	$(BIN)/python -m hatchling build
	$(BIN)/twine check --strict dist/*
	$(BIN)/python -m tests.release.sbom dist/gellight.cdx.json

# Pin everything that `pip install gellight` brings, with hashes; say which of it has known weaknesses. Both need a network.
lock: $(VENV)/.dev
	$(BIN)/uv pip compile pyproject.toml --universal --python-version 3.11 --generate-hashes --upgrade --quiet \
	    --custom-compile-command "make lock" --output-file host/requirements.txt

audit: $(VENV)/.dev
	$(BIN)/python -m tests.release.audit

# How far pip is: it shows that itself on a terminal; in a log, a line every ten seconds. $(1): what to install,
# $(2): packages that are there at the end.
define install
	@if [ -t 1 ]; then $(BIN)/pip install $(1); else \
	    (begun=$$(date +%s); while sleep 10 >/dev/null; do \
	        echo "installing: $$(ls -d $(VENV)/lib/python*/site-packages/*.dist-info | wc -l) of about $(2) packages" \
	            "are there ($$(($$(date +%s) - begun)) s)"; done) & beat=$$!; \
	    $(BIN)/pip install --quiet $(1); ended=$$?; kill $$beat; exit $$ended; fi
endef

# A stamp says what is installed: `host` is what a user runs, `parts` adds boards, housing and the CAD kernel, `docs`
# what makes the site, `test` what `make test` runs, `dev` PyTorch and the rest of the test tools.
$(VENV)/.host: pyproject.toml host/gellight_ros/pyproject.toml host/gellight_scan/pyproject.toml | $(BIN)/python
	@echo "Installing GelLight and 38 packages that it needs into $(VENV): 580 MB, one to three minutes, once"
	$(call install,--editable . --editable host/gellight_ros --editable host/gellight_scan,42)
	@touch $@

$(VENV)/.parts: pyproject.toml host/gellight_design/pyproject.toml | $(VENV)/.host
	$(call install,--editable . --editable "host/gellight_design[housing]",48)
	@touch $@

$(VENV)/.docs: pyproject.toml | $(VENV)/.host
	$(call install,--editable ".[docs]",80)
	@touch $@

$(VENV)/.test: pyproject.toml $(wildcard host/*/pyproject.toml) | $(BIN)/python
	@echo "Installing GelLight and what its tests need into $(VENV): 1 GB, one to three minutes, once"
	$(call install,--editable ".[test]" $(BESIDE),85)
	@touch $@ $(VENV)/.host

$(VENV)/.dev: pyproject.toml $(wildcard host/*/pyproject.toml) | $(BIN)/python
	@echo "Installing PyTorch and what the tests need into $(VENV): some GB come, which takes minutes, once"
	$(call install,"$(TORCH)",80)
	$(call install,--editable ".[dev]" $(BESIDE) --editable "host/gellight_design[housing]",150)
	@touch $@ $(VENV)/.test $(VENV)/.host

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "GelLight needs Python 3.11 or newer: sudo apt-get install python3, or make PYTHON=/path/to/python3.11"; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' || \
	    { echo "Python cannot make a virtual environment: sudo apt-get install python3-venv"; exit 2; }
	@echo "Making $(VENV), a Python environment of its own: half a minute"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install --quiet --upgrade pip

# $(1): programs that may be called one name or another, each with its package: "chromium|google-chrome=chromium".
# Root installs what is missing; what anyone else is told stands in $(2).
define debian
	@missing=; for need in $(1); do \
	    found=; for name in $$(echo $${need%=*} | tr '|' ' '); do command -v $$name >/dev/null && found=1; done; \
	    [ "$$found" ] || missing="$$missing $${need#*=}"; done; \
	[ -z "$$missing" ] || \
	    { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && \
	      { apt-get update -qq && apt-get install -y -qq --no-install-recommends $$missing >/dev/null; }; } || \
	    { $(2); }
endef

# The page is tried in a real browser. Without one its tests are left out, and the last lines of the run say so.
.PHONY: browser tools
browser:
	$(call debian,"chromium|chromium-browser|google-chrome=chromium",echo "No Chromium: the tests of the page are left out")

# A second browser for the page, a second compiler and a second emulator for the firmware, an emulator for the frame path
# on aarch64, KiCad for the boards (45 MB and 37 packages beside it: two minutes). The virtual machine's kernel and tools
# are only unpacked, into a cache folder.
tools:
	$(call debian,"firefox-esr|firefox=firefox-esr" "arm-none-eabi-gcc=gcc-arm-none-eabi" "gcc=gcc" \
	    "qemu-aarch64=qemu-user" "kicad-cli|pcbnew=kicad" "npm=nodejs npm",echo "The tests need: sudo apt-get install \
	    --no-install-recommends $$missing"; exit 2)
	@$(PYTHON) -m tests.vm.machine.packages
	@[ -d $(SECOND)/node_modules/rp2040js ] || npm ci --prefix $(SECOND) --ignore-scripts --no-audit --no-fund --silent

clean:
	rm -rf $(VENV) build dist
