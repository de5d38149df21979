# Every target does its own set-up: a virtual environment in .venv, made once and made again when pyproject.toml changes.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
# Some systems ask Python to keep nothing compiled: then each of the many processes that tests start would compile all of it again.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo quick test test-web test-socketcan check bench scenarios bench-cycle bench-core bench-guests bench-fleet docs campaign bounds fuzz flaky explore mutants pictures format clean

demo: $(READY)            ## the main job on the simulated cell; writes demo-output/
	$(BIN)/axisbus demo

quick: $(READY)           ## the quick tests, in two processes: after each edit
	$(BIN)/python -m pytest -m "not slow" -n 2 --dist loadfile

# A test in real time fails where a busy computer keeps it waiting: at most 24 such are given once more, with nothing beside them.
test: $(READY)            ## all tests, in three processes (many wait for drives in real time); in a new tree compiled once, for all of them
	test -d tests/__pycache__ || $(BIN)/python -m pytest --collect-only -qq > /dev/null || true
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder || \
	{ test $$? = 1 && $(BIN)/python -m pytest --alone --last-failed --last-failed-no-failures none; }
	$(MAKE) test-web

# A browser and its page need the computer for themselves.
test-web: $(READY)        ## the page in a real Chromium, where there is one; pictures of its views in demo-output/web
	AXISBUS_BROWSER=1 $(BIN)/python -m pytest tests/web/test_web_browser*.py || \
	{ test $$? = 1 && AXISBUS_BROWSER=1 $(BIN)/python -m pytest --alone --last-failed --last-failed-no-failures none; }

scenarios: $(READY)         ## the scenarios in both modes: the core in a thread of its program, and in a process of its own
	for mode in thread own; do \
		AXISBUS_PROCESS=$$mode $(BIN)/python -m pytest tests/scenarios -n 2 --dist loadfile || { test $$? = 1 && \
		AXISBUS_PROCESS=$$mode $(BIN)/python -m pytest --alone --last-failed --last-failed-no-failures none; } || exit 1; \
	done

test-socketcan: $(READY)  ## the bus-level tests over the kernel's CAN (vcan), here or inside a user-mode Linux
	.ci/socketcan

check: $(READY)           ## lint, format, types, layers
	$(BIN)/ruff check src tests examples docs/site
	$(BIN)/ruff format --check src tests examples docs/site
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(READY)            ## the site of the documentation, its links checked: build/docs/html/index.html
	$(BIN)/python docs/site/build.py

bench: $(READY)           ## ratios against a baseline in the same run
	$(BIN)/python tests/bench.py

bench-cycle: $(READY)     ## CPU of a whole cycle over a socket, against canopen's PDO maps in the same run
	PYTHONPATH=tests $(BIN)/python tests/bench_cycle.py

bench-core: $(READY)      ## a core in a process of its own: SYNC beside busy programs, full wires, opening; minutes, needs cc
	PYTHONPATH=tests $(BIN)/python tests/bench_core.py

bench-guests: $(READY)    ## what recordings, monitors and attacks beside a core cost its cycle; some twenty minutes
	PYTHONPATH=tests $(BIN)/python tests/bench_guests.py

bench-fleet: $(READY)     ## what a fleet costs: 100 cells by stand-ins, and up to 20 simulated ones in processes; minutes
	PYTHONPATH=tests $(BIN)/python tests/bench_fleet.py

campaign: $(READY)        ## 10,000 fresh scenarios of random commands and mishaps, half of them on random cells, with a table
	$(BIN)/python tests/campaign.py

bounds: $(READY)          ## 10,000 random commands of axes that the master leads, with the highest share of each limit
	$(BIN)/python tests/bounds.py

fuzz: $(READY)            ## 100,000 mutated files, frames and messages for every reader of bytes from outside; a day
	PYTHONPATH=tests $(BIN)/python tests/fuzz_readers.py

flaky: $(READY)           ## the tests 20 times under CPU load, with counts
	$(BIN)/python tests/flaky.py

explore: $(READY)         ## the tests of properties with fresh examples, others in each run, and the whole sweep of lost frames
	AXISBUS_EXAMPLES=fresh $(BIN)/python -m pytest -n 4 --dist loadfile -m hypothesis
	AXISBUS_EXAMPLES=fresh $(BIN)/python -m pytest tests/sim/test_sim_sdo_sweep.py

pictures: $(READY)        ## draws the pictures of docs/motion.md again
	$(BIN)/python tests/pictures.py

mutants: $(READY)         ## small wrong changes of the source: at least 90 % must be noticed by a test
	$(BIN)/python tests/mutants.py

format: $(READY)
	$(BIN)/ruff check --fix src tests examples docs/site
	$(BIN)/ruff format src tests examples docs/site

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,plot,record]'
	touch $(READY)

clean:
	rm -rf $(VENV) build demo-output .mutants-map .pytest_cache .mypy_cache .ruff_cache .hypothesis
