# Everything a developer does. Every target sets up what it needs; `make help` lists them.
#
# PYTHON       the interpreter for new environments (default: the first of python3, python3.13,
#              ... python3.10 that runs)
# PYTEST_ARGS  added to the command line of pytest
# GOLDEN_ARGS  added to the command line of the golden check

MAKEFLAGS += --no-print-directory
.DEFAULT_GOAL := help

# Functions are compiled at the installation, so that no first start does so; in CI by the tests,
# each where it is first called.
COMPILE_NOW := $(if $(filter true,$(CI)),,compile)

# With ROS 2 Jazzy sourced that one is used, from an environment of its own; otherwise Jazzy comes
# as wheels, and nothing of another ROS may leak in.
ifeq ($(ROS_DISTRO),jazzy)
VENV := .venv-jazzy
SET_UP := $(VENV) requirements/jazzy.txt system $(COMPILE_NOW)
AMENT := $(CURDIR)/$(VENV):$(AMENT_PREFIX_PATH)
else
VENV := .venv
SET_UP := $(VENV) requirements/wheels.txt own $(COMPILE_NOW)
AMENT := $(CURDIR)/$(VENV)
unexport PYTHONPATH
endif
OLDEST := .venv-oldest

# Where Python may not keep what it compiled, each of hundreds of processes compiles it again.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE PYTHONHOME PYTHONDONTWRITEBYTECODE
export PYTHON
RUN := PATH="$(CURDIR)/$(VENV)/bin:$$PATH" AMENT_PREFIX_PATH="$(AMENT)" \
       ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST OPENBLAS_NUM_THREADS=1

.PHONY: help demo test test-nodes test-oldest test-oldest-meanwhile dependencies-oldest \
        test-package golden lint bench functions docs docs-pages site venv messages lock \
        clean

help: ## List the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1|/p' $(MAKEFILE_LIST) | \
	    while IFS='|' read -r target text; do printf '  make %-12s %s\n' "$$target" "$$text"; done

demo: venv ## Simulate a tray, watch it cool, estimate the coefficient of restitution
	@$(RUN) python $(VENV)/lib/nanorocks_ros/demo

# Nodes talk to one another in real time: not beside what keeps all cores busy for minutes.
NODES := test/nodes test/test_colcon.py
SIDE_BY_SIDE := --numprocesses auto --dist loadfile
# In the order of test/conftest.py; the oldest pytest-xdist sorts files in its own.
LONGEST_FIRST := $(SIDE_BY_SIDE) --no-loadscope-reorder

# The tests of the nodes mostly wait: meanwhile those with the oldest dependencies run, in time that
# they leave.
test: venv ## Run all tests, and those of the core with the oldest dependencies
	@$(RUN) python -m pytest $(LONGEST_FIRST) $(patsubst %,--ignore=%,$(NODES)) $(PYTEST_ARGS)
	@$(MAKE) --jobs 2 test-nodes test-oldest-meanwhile

test-nodes: venv
	@$(RUN) python -m pytest $(SIDE_BY_SIDE) $(NODES) $(PYTEST_ARGS)

# What it says comes at the end, in one piece.
test-oldest-meanwhile:
	@mkdir -p build; status=0; \
	    nice -n 19 $(MAKE) test-oldest >build/test_oldest.log 2>&1 || status=$$?; \
	    cat build/test_oldest.log; exit $$status

# What takes minutes and only goes through, once more, what other tests go through (or compares a
# picture, which another Matplotlib letters in another way; or reads texts of the repository alone):
# analyses of whole bags go through all stages and the inference. The simulation is the same, bit
# by bit, with all dependencies, and one command of it is enough. Kills at each step of the work on
# files (`-k`) are up to the operating system.
ONCE := test/golden test/validation test/simulation test/inference test/stages test/pipeline \
        test/dashboard/test_page.py test/physics/test_confined_theory.py \
        test/studies/reproduction test/studies/batch test/studies/calibration \
        test/studies/libraries test/studies/sweeps test/cli/simulation/test_sweep.py \
        test/cli/figures/test_figure_cor.py test/cli/simulation/test_simulate_scene.py \
        test/test_contributing.py test/test_docs_code.py test/test_printed_numbers.py \
        test/test_tutorial.py test/test_gallery.py test/interface test/studies/measure \
        test/cli/films test/studies/gas_statistics test/tools/docs_pages test/tools/compilation \
        test/studies/figures/test_demo_figure.py test/studies/inspection \
        test/dashboard/test_page_views.py test/cli/test_bag_settings.py \
        test/cli/test_interrupts.py test/test_docs.py test/test_external_links.py \
        test/test_mirror.py test/test_validation_tables.py test/test_installation.py \
        test/physics/test_paper_numbers.py test/studies/synthetic/test_trajectory.py \
        test/studies/synthetic/test_simulated_runs.py test/physics/test_rough_spheres.py \
        test/studies/decays

# Beside `make venv`, see .ci/run.
dependencies-oldest:
	@sh requirements/set_up.sh $(OLDEST) requirements/oldest.txt own dependencies

# Two processes of tests, and what these start, would compile the same functions side by side.
OLDEST_CACHE := NUMBA_CACHE_DIR="$(CURDIR)/$(OLDEST)/numba"
test-oldest: ## Run the tests of the core, without ROS, with the oldest dependencies
	@$(OLDEST_CACHE) sh requirements/set_up.sh $(OLDEST) requirements/oldest.txt own compile
	@env -u PYTHONPATH OPENBLAS_NUM_THREADS=1 $(OLDEST_CACHE) \
	    PATH="$(CURDIR)/$(OLDEST)/bin:$$PATH" python -m pytest \
	    $(SIDE_BY_SIDE) $(patsubst %,--ignore=%,$(NODES) $(ONCE)) -k 'not at_any_step' $(PYTEST_ARGS)

test-package: venv ## Make the wheel and run it where there is neither ROS nor this tree
	@sh requirements/test_package.sh "$(CURDIR)/$(VENV)/bin/python" .venv-package

golden: venv ## Hold every number that the commands give against test/golden/golden.json
	@$(RUN) python -m benchmarks golden $(GOLDEN_ARGS)

lint: venv ## Check style, format, types and which module may import which
	@$(RUN) ruff check .
	@$(RUN) ruff format --check .
	@$(RUN) mypy
	@$(RUN) lint-imports --no-logo

bench: venv ## Measure against the limits and against peers
	@$(RUN) python -m benchmarks

functions: venv ## Renew the list of functions that are compiled at an installation (minutes)
	@$(RUN) python -m nanorocks_ros.tools.compilation.function_list

docs: docs-pages site ## Renew the generated pages of docs/, and build the site

docs-pages: venv ## Renew the pages of docs/ that are made from the code (minutes)
	@$(RUN) python -m nanorocks_ros.tools.docs_pages.wire_pages
	@$(RUN) python -m nanorocks_ros.nodes.reference

site: venv ## Build the documentation into build/site, with search
	@$(RUN) python -m nanorocks_ros.tools.docs_pages.site

venv: ## Set up the environment that all of these use, with its functions compiled
	@case '$(ROS_DISTRO)' in ''|jazzy) ;; *) \
	    echo 'ROS 2 $(ROS_DISTRO) is sourced: use a shell without ROS, or with Jazzy' >&2; exit 1; \
	esac
	@sh requirements/set_up.sh $(SET_UP)

messages: ## Build the typed messages from wheels, for their tests (needs cmake and a compiler)
	@sh requirements/set_up.sh .venv-messages requirements/messages.txt
	@sh requirements/build_messages.sh .venv-messages build/messages msg_defs/nanorocks_msgs

# For maintainers: the other targets only read the lock files. Needs `uv` (pip install uv).
COMPILE := uv pip compile --quiet --universal --python-version 3.10 --no-annotate --generate-hashes \
           --no-emit-package nanorocks-ros --custom-compile-command 'make lock' setup.cfg
lock: ## Renew the lock files in requirements/ (needs uv)
	@$(COMPILE) --upgrade --extra dev --extra ros --output-file requirements/wheels.txt
	@echo "numpy < 2; python_version < '3.13'" | $(COMPILE) --upgrade --extra dev \
	    --constraints - --output-file requirements/jazzy.txt
	@$(COMPILE) --upgrade --extra test --resolution lowest-direct \
	    --output-file requirements/oldest.txt
	@$(COMPILE) --upgrade --extra messages --output-file requirements/messages.txt

clean: ## Remove the environments, builds and caches
	@rm -rf .venv .venv-jazzy .venv-messages .venv-package $(OLDEST) build install log \
	    ./*.egg-info \
	    .hypothesis .mypy_cache .pytest_cache .ruff_cache .import_linter_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
