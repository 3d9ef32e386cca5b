# Everything happens in a virtual environment of this folder; nothing else on the machine is touched.
PYTHON ?= python3
BIN := .venv/bin
DEMO := demo-out

.PHONY: demo test lint test-faults bench scoreboard clean

demo: .venv/post.stamp
	rm -rf $(DEMO)
	@echo "== walk: 31 minutes at 40 times the speed, simulated modem and receiver behind real ptys (50 s)"
	$(BIN)/fieldlogger simulate --out $(DEMO) --speed 40 --seed 3
	mv $(DEMO)/run-2*Z.h5 $(DEMO)/run.h5 && mv $(DEMO)/run-2*Z.journal $(DEMO)/run.journal
	@echo "== desk"
	$(BIN)/postproc smooth $(DEMO)/run.h5
	$(BIN)/postproc view $(DEMO)/run.h5 --save $(DEMO)/run.rrd
	$(BIN)/postproc plot $(DEMO)/run.h5 -o $(DEMO)/run.png
	@echo "== done: $(DEMO)/run.png is the picture; $(BIN)/rerun $(DEMO)/run.rrd opens the walk in rerun"

test: lint
	$(BIN)/pytest -m "not slow"

lint: .venv/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# kill -9 at 50 random moments, and what else takes its time
test-faults: .venv/dev.stamp
	CELLWALK_KILLS=50 $(BIN)/pytest -s tests/device/test_kill.py
	$(BIN)/pytest -m slow

bench: .venv/dev.stamp
	$(BIN)/python benchmarks/ekf_step.py
	$(BIN)/python benchmarks/drivers.py
	$(BIN)/python benchmarks/live_cell.py
	$(BIN)/python benchmarks/desk_filter.py
	$(BIN)/python benchmarks/desk.py

# errors and coverage of every estimator over simulated and measured walks: about half an hour
scoreboard: .venv/dev.stamp
	$(BIN)/python benchmarks/accuracy.py

.venv/pip.stamp:
	$(PYTHON) -m venv .venv
	touch $@

.venv/post.stamp: .venv/pip.stamp pyproject.toml
	$(BIN)/pip install --disable-pip-version-check -e '.[post]'
	touch $@

.venv/dev.stamp: .venv/pip.stamp pyproject.toml
	$(BIN)/pip install --disable-pip-version-check -e '.[dev]'
	touch $@ .venv/post.stamp

clean:
	rm -rf .venv $(DEMO)
