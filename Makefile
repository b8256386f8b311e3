# SPDX-License-Identifier: Apache-2.0
# `make run` and `make test` set up all they need, once. Choose with PYTHON=python3.12,
# VENV=folder; pass arguments with ARGS="…".

VENV ?= .venv
# Workers of the tests: they wait for boards a third of their time, so one more than two cores.
JOBS ?= 3
BIN := $(VENV)/bin
SETUP := PYTHON="$(PYTHON)" tools/set-up "$(VENV)"
PYTEST := $(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder

# This environment stands on its own: a sourced ROS 2 of another Python would break it.
ifneq ($(AMENT_PREFIX_PATH)$(_ROS_WHEELS_BOOTSTRAP_COMPLETE),)
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH
unexport RMW_IMPLEMENTATION ROS_DISTRO ROS_VERSION ROS_PYTHON_VERSION
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
endif

# Each board that a test starts would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help run panel test test-long check bench motion soak conformance mutants judges docs house site wheels setup clean distclean

help: ## Say what there is
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 20

run: ## Start the arm; ARGS="--ros-args --params-file …" go to the node
	@$(SETUP)
	@$(BIN)/control_board $(ARGS)

panel: ## Open the web panel beside a running board; ARGS="--port …" go to cbctl panel
	@$(SETUP) panel
	@$(BIN)/cbctl panel $(ARGS)

test: ## Run the tests; ARGS="-k M4" go to pytest
	@$(SETUP) test icub
	@$(PYTEST) -m "not slow and not soak" $(ARGS)

test-long: ## Run the tests that take more than a second each
	@$(SETUP) test icub
	@$(PYTEST) -m "slow and not soak" $(ARGS)

check: ## Run ruff, mypy --strict, import-linter; oxlint and tsc on the page's JavaScript
	@$(SETUP) test dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy --config-file benchmark/mypy.ini benchmark
	$(BIN)/lint-imports --no-cache --no-logo
	@if [ -x $(BIN)/oxlint ]; then set -x; \
	    $(BIN)/oxlint --deny-warnings --ignore-pattern '**/vendor/**' control_board_ros; \
	else echo "JavaScript is not linted: oxlint is for Linux on x86_64"; fi
	@if command -v tsc >/dev/null; then set -x; tsc --project control_board_ros/panel; \
	else echo "types of JavaScript are not checked: no tsc (npm install -g typescript)"; fi

bench: ## Measure the figures of the README
	@$(SETUP) test dev icub
	@$(BIN)/python benchmark/run.py $(ARGS)

motion: ## Measure how well joints move, write docs/motion.md
	@$(SETUP) test dev icub
	@$(BIN)/python benchmark/motion.py $(or $(ARGS),--page --plots)

soak: ## Run the board for a long time under load, then the tests that take minutes each
	@$(SETUP) test dev icub
	@$(BIN)/python benchmark/soak.py $(ARGS)
	@$(PYTEST) -m soak

conformance: ## Run the tests of all rules, try them on a board of each make, write docs/conformance.md
	@$(SETUP) test
	@$(BIN)/python test/spec/conformance.py $(ARGS)

mutants: ## Break the core in small ways: a test must fail; ARGS=--all for every way
	@$(SETUP) test icub
	@$(BIN)/python test/spec/mutants.py $(ARGS)

judges: ## Fetch clients of drives that cannot be installed beside the others, for test/judged
	@$(SETUP) test
	@for judge in ftservo-python-sdk==2.0.1 lerobot==0.4.4; do \
	    $(BIN)/python -m pip install -q --no-deps --upgrade \
	        --target "$(VENV)/judges/$${judge%%=*}" "$$judge" || exit; \
	done

docs: ## Write the generated pages of docs/; ARGS=--pictures draws anew
	@$(SETUP) test dev
	@$(BIN)/python docs/generate.py $(ARGS)

site: ## Build the site from docs/ into build/site; warnings and dead links are errors
	@$(SETUP) site
	@$(BIN)/python docs/site/build.py $(ARGS)

wheels: ## Build sdist and manylinux wheels into dist/; PYTHON="python3.11 python3.12" names the Pythons
	@tools/build-wheels $(or $(PYTHON),python3.11 python3.12)

house: ## Print lines, floors and circles with their goals; ARGS=-v names them
	@$(SETUP) dev
	@$(BIN)/python tools/house.py $(ARGS)

setup: ## Make the environment, where it is not up to date; EXTRAS="test icub" names more of it
	@$(SETUP) $(EXTRAS)

clean: ## Remove what was built, and caches; keeps the environment
	rm -rf build install log *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	rm -rf .import_linter_cache .benchmarks
	find control_board_ros test benchmark docs -name __pycache__ -prune -exec rm -rf {} + \
	    2>/dev/null || true

distclean: clean ## Remove the environment too
	rm -rf $(VENV)
	find control_board_ros -name '*.so' -delete
