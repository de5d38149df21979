# Each target sets up the virtual environment .venv if it is missing or older than pyproject.toml.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
# Some systems tell Python not to write bytecode. Then each of the many processes that the tests start would compile all modules.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help dist matrix demo quick test test-generic test-sweeps test-real test-web test-socketcan check bench scenarios bench-cycle bench-core bench-clients bench-fleet docs campaign bounds fuzz flaky explore mutants pictures format clean

help:                     ## list the targets
	@sed -n 's/^\([a-z-]*\):[^#]*## /\1\t/p' Makefile | expand -t 16

demo: $(READY)            ## run the demo on the simulated cell; writes demo-output/
	$(BIN)/axisbus demo

quick: $(READY)           ## run the quick tests in two processes, after each edit
	$(BIN)/python -m pytest -m "not slow" -n 2 --dist loadfile

test: $(READY)            ## run the tests whose result does not depend on the load of the computer, except sweeps, in two processes
	@echo "collecting the tests: up to a minute before the first result"
	test -d tests/__pycache__ || $(BIN)/python -m pytest --collect-only -qq > /dev/null || true
	$(BIN)/python -m pytest -m "not real_time and not sweep" -n 2 --dist loadfile

test-sweeps: $(READY)     ## run the sweeps: random runs, every combination, makers' files; the load of the computer does not matter
	$(BIN)/python -m pytest -m sweep -n 2 --dist loadfile

test-generic: $(READY)    ## run the quick tests on a copy of the sources without the plug-in of the GIM6010-8, in build/generic
	$(BIN)/python tests/without_plugin.py -m "not slow" -n 2 --dist loadfile

test-real: $(READY)       ## run the tests that need real processes, sockets, a browser or the kernel
	$(BIN)/python -m pytest -m real_time -n 2 --dist loadfile
	$(MAKE) test-web

# The tests of the browser run alone: a browser and its page need the whole computer.
test-web: $(READY)        ## test the page in a real Chromium, if there is one; writes pictures to demo-output/web
	AXISBUS_BROWSER=1 $(BIN)/python -m pytest tests/web/test_web_browser*.py

scenarios: $(READY)         ## run the scenarios in both modes: the core in its program, and in a process of its own
	for mode in thread own; do \
		AXISBUS_PROCESS=$$mode $(BIN)/python -m pytest tests/scenarios -n 2 --dist loadfile || exit 1; \
	done

test-socketcan: $(READY)  ## run the bus-level tests over the kernel's CAN (vcan), on this kernel or in a user-mode Linux
	.ci/socketcan

check: $(READY)           ## check lint, format, types, layers
	$(BIN)/ruff check src tests examples docs/site
	$(BIN)/ruff format --check src tests examples docs/site
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(READY)            ## build the documentation site and check its links: build/docs/html/index.html
	$(BIN)/python docs/site/build.py

bench: $(READY)           ## measure ratios against a baseline of the same run
	$(BIN)/python tests/bench.py

bench-cycle: $(READY)     ## measure the CPU time of a cycle over a socket, against canopen's PDO maps in the same run
	PYTHONPATH=tests $(BIN)/python tests/bench_cycle.py

bench-core: $(READY)      ## measure a core process: SYNC beside busy programs, full buses, opening; minutes, needs cc
	PYTHONPATH=tests $(BIN)/python tests/bench_core.py

bench-clients: $(READY)   ## measure the cost of recordings, monitors and attacks for the cycle of a core; about twenty minutes
	PYTHONPATH=tests $(BIN)/python tests/bench_clients.py

bench-fleet: $(READY)     ## measure the cost of a fleet: 100 cells played by a test program, and up to 20 simulated cells in processes; minutes
	PYTHONPATH=tests $(BIN)/python tests/bench_fleet.py

campaign: $(READY)        ## run 10,000 new scenarios of random commands and failures, half of them on random cells; prints a table
	$(BIN)/python tests/campaign.py

bounds: $(READY)          ## give 10,000 random commands with set-points streamed by the master; prints the highest share of each limit
	$(BIN)/python tests/bounds.py

fuzz: $(READY)            ## give 100,000 mutated files, frames and messages to every reader of external bytes; takes a day
	PYTHONPATH=tests $(BIN)/python tests/fuzz_readers.py

flaky: $(READY)           ## run the tests 20 times under CPU load, and count failures
	$(BIN)/python tests/flaky.py

explore: $(READY)         ## run the property-based tests with new examples in each run, and the whole sweep of lost frames
	AXISBUS_EXAMPLES=fresh $(BIN)/python -m pytest -n 4 --dist loadfile -m hypothesis
	AXISBUS_EXAMPLES=fresh $(BIN)/python -m pytest tests/sim/test_sim_sdo_sweep.py

pictures: $(READY)        ## draw the pictures of docs/motion.md
	$(BIN)/python tests/pictures.py

mutants: $(READY)         ## insert small errors into the source: tests must notice at least 90 % of them
	$(BIN)/python tests/mutants.py

dist: $(READY)            ## build wheel and sdist into dist/, check them, and try the wheel with each Python of this computer
	$(BIN)/python tests/dist.py

matrix: $(READY)          ## try each Python of this computer, the lowest versions of the dependencies, and each extra alone
	$(BIN)/nox -s smoke lowest extra

format: $(READY)          ## format the sources
	$(BIN)/ruff check --fix src tests examples docs/site
	$(BIN)/ruff format src tests examples docs/site

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,plot,record]'
	touch $(READY)

clean:                    ## delete the virtual environment and all that was built
	rm -rf $(VENV) build dist demo-output .mutants-map .nox .grimp_cache .pytest_cache .mypy_cache .ruff_cache .hypothesis
