# Everything happens in a virtual environment of this folder; nothing else on the machine is touched.
PYTHON ?= python3
BIN := .venv/bin
DEMO := demo-out
# The tests start hundreds of Python processes; without this each would compile every module again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo page test test-oldest lint house test-faults planted-faults test-boot test-view screenshots fuzz soak bench scoreboard truth suspicion guidance deb card-debs dist docs page-map clean

demo: .venv/post.stamp
	rm -rf $(DEMO)
	@echo "== walk: 31 minutes at 40 times the speed, simulated modem and receiver behind real ptys (50 s)"
	$(BIN)/fieldlogger simulate --out $(DEMO) --speed 40 --seed 3
	mv $(DEMO)/run-000001.h5 $(DEMO)/run.h5 && mv $(DEMO)/run-000001.journal $(DEMO)/run.journal
	@echo "== desktop program"
	$(BIN)/postproc smooth $(DEMO)/run.h5
	$(BIN)/postproc view $(DEMO)/run.h5 --save $(DEMO)/run.rrd
	$(BIN)/postproc plot $(DEMO)/run.h5 -o $(DEMO)/run.png
	$(BIN)/postproc report $(DEMO)/run.h5
	@echo "== done: open $(DEMO)/run.html in a browser,"
	@echo "   or the walk in the viewer: $(BIN)/postproc view $(DEMO)/run.rrd"

# the page on the phone without a Pi: a simulated walker follows its advice; Ctrl-C ends it
page: .venv/post.stamp
	$(BIN)/fieldlogger simulate --scenario city-rogue --page --follow --out $(DEMO)/page

# Four processes for two processors, because many tests wait for a service in real time; WORKERS=0
# runs the tests one after another, for a debugger.
WORKERS ?= 4
test: lint
	$(BIN)/pytest -m "not slow" -n $(WORKERS) --dist worksteal $(AGAIN)

lint: .venv/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell

# size of the code and of its documents beside the committed figures; `--write` commits those of today
house: .venv/dev.stamp
	$(BIN)/python tools/house.py

# the logger with the oldest libraries it allows, those of Debian 12; without tests of the desktop program, of replies
# of modems and of what is said to them, which no library reads, and without statistics and repeated kills: a third of
# the time, which `make test` has
OLDEST := numpy==1.24.* h5py==3.8.* pyproj==3.4.* pyserial==3.5 pynmea2==1.15.* msgspec==0.18.0 click==8.1.* tornado==6.2.* segno==1.4.*
# On processors with AVX-512 numpy 1.24 computes exp and log of few numbers in one of two ways, by the addresses of its
# arrays, which differ in the last bit; without it equal input has equal output, as on a Pi and with later versions.
test-oldest: .venv/oldest.stamp
	! grep -q avx512vl /proc/cpuinfo || export NPY_DISABLE_CPU_FEATURES="AVX512F AVX512_SKX"; \
	.venv/oldest/bin/pytest -m "not slow" -o cache_dir=.venv/oldest/cache $(AGAIN) \
		$$(grep -rLE '^ *(from|import) (postproc|benchmarks|scipy|filterpy)' \
		--include='test_*.py' --exclude=test_truth.py --exclude=test_any_input.py --exclude=test_marks.py \
		--exclude=test_walker.py --exclude=test_posterior.py --exclude=test_live_scale.py \
		--exclude=test_modem_source.py --exclude='test_mode_*.py' --exclude='test_lost_digits.py' \
		--exclude=test_scan_timeout.py --exclude=test_late_rows.py --exclude=test_neighbour_lists.py \
		--exclude-dir=guidance tests/core tests/device tests/drivers/protocols tests/page)

# Debian packages for the Pi (ARCH names one: amd64, arm64, armhf) in dist/, checked by lintian where it is installed
deb: page-map
	systemd/debian/build.sh $(ARCH)
	! command -v lintian >/dev/null || lintian --fail-on error dist/fieldlogger_*.deb

# what systemd/prepare-card.sh --debs takes: the package and all it needs of a release, to install without a network
SUITE ?= trixie
CARD_DEBS = dist/card-$(SUITE)-$(or $(ARCH),arm64)
card-debs: page-map
	systemd/debian/card_debs.sh $(CARD_DEBS) $(or $(ARCH),arm64) $(SUITE)

# MapLibre and pmtiles for the page's plan over a map, packed into the wheel and the .deb; without npm it has a grid
MAP := logger/page/assets/map
page-map:
	mkdir -p $(MAP)
	test -e $(MAP)/maplibre-gl.mjs || { npm install --silent --no-fund --prefix .venv/map \
		maplibre-gl@6.17.0 pmtiles@4.5.0 && cd .venv/map/node_modules && cp maplibre-gl/dist/maplibre-gl.mjs \
		maplibre-gl/dist/maplibre-gl-worker.mjs maplibre-gl/dist/maplibre-gl.css pmtiles/dist/pmtiles.js \
		../../../$(MAP) && cp maplibre-gl/LICENSE.txt ../../../$(MAP)/maplibre-gl.licence.txt && \
		cp fflate/LICENSE ../../../$(MAP)/fflate.licence.txt; } || echo "no npm: the page's plan has a grid"

# the long tests: the service killed 50 times, a recorder 1000 times; damaged journals, failing cards
test-faults: .venv/dev.stamp
	CELLWALK_KILLS=50 $(BIN)/pytest -s tests/device/test_kill.py
	$(BIN)/pytest -s tests/device/test_faults.py
	CELLWALK_BASELINE_KILLS=50 $(BIN)/pytest -s tests/postproc/baseline/test_kill.py
	$(BIN)/pytest -m slow --ignore tests/boot --ignore tests/view --deselect tests/device/test_kill.py --deselect tests/core/runfile/test_soak.py

# faults planted one by one into a copy of the code: the tests have to notice each; some minutes
planted-faults: .venv/dev.stamp
	$(BIN)/python tools/planted_faults.py

# wheel and source distribution as an index takes them, with the page's map
dist: .venv/dev.stamp page-map
	$(BIN)/python -m build --outdir dist
	$(BIN)/twine check --strict dist/cellwalk-*

# coverage-guided fuzzing, an hour for each target; see tests/fuzz/README.md
FUZZ_S ?= 3600
fuzz: .venv/dev.stamp
	$(BIN)/pip install --disable-pip-version-check atheris
	mkdir -p .venv/fuzz/at .venv/fuzz/nmea .venv/fuzz/journal .venv/fuzz/diag .venv/fuzz/diag_records
	PYTHONPATH=. $(BIN)/python tests/fuzz/fuzz_at.py -max_total_time=$(FUZZ_S) .venv/fuzz/at
	PYTHONPATH=. $(BIN)/python tests/fuzz/fuzz_nmea.py -max_total_time=$(FUZZ_S) .venv/fuzz/nmea
	PYTHONPATH=. $(BIN)/python tests/fuzz/fuzz_journal.py -max_total_time=$(FUZZ_S) -max_len=2048 -len_control=0 .venv/fuzz/journal
	PYTHONPATH=. $(BIN)/python tests/fuzz/fuzz_diag.py -max_total_time=$(FUZZ_S) .venv/fuzz/diag
	PYTHONPATH=. $(BIN)/python tests/fuzz/fuzz_diag_records.py -max_total_time=$(FUZZ_S) .venv/fuzz/diag_records
	PYTHONPATH=. $(BIN)/python tests/fuzz/fuzz_hdf5.py -max_total_time=$(FUZZ_S)
	PYTHONPATH=. $(BIN)/python tests/fuzz/fuzz_foreign.py -max_total_time=$(FUZZ_S)

# a complete boot under QEMU with ../shared/bootrig: install, walk, unplug, power cut; half an hour without KVM
# CELLWALK_CUTS=300 CELLWALK_REPLUGS=50 CELLWALK_BOARD=arm64 CELLWALK_BOOT_CACHE=DIR (for the image; 6 GB)
test-boot: .venv/dev.stamp
	$(BIN)/pytest -s tests/boot

# the viewer with software rendering, and the pages in a real browser; skips what is not installed. On Debian:
# apt-get install chromium chromium-driver mesa-vulkan-drivers npm strace
AXE := .venv/axe/node_modules/axe-core/axe.min.js
test-view: .venv/dev.stamp
	test -e $(AXE) || npm install --silent --no-fund --prefix .venv/axe axe-core@4.14.1 || true
	CELLWALK_AXE=$(AXE) $(BIN)/pytest -m slow -n $(if $(AGAIN),0,2) -o cache_dir=.venv/view-cache $(AGAIN) tests/view tests/page

# the pictures of the guide: the page on a phone during a simulated walk, the report and the survey
screenshots: .venv/dev.stamp
	CELLWALK_SCREENSHOTS=docs/page $(BIN)/pytest tests/page/test_phone.py tests/view -k screenshots

# a day of records at full speed, bytes written in an hour, and the service for two hours in real time
soak: .venv/dev.stamp
	$(BIN)/pytest -s tests/core/runfile/test_soak.py
	$(BIN)/python benchmarks/recording.py
	$(BIN)/python benchmarks/soak.py

bench: .venv/dev.stamp
	$(BIN)/python benchmarks/ekf_step.py
	$(BIN)/python benchmarks/drivers.py
	$(BIN)/python benchmarks/false_identities.py
	$(BIN)/python benchmarks/false_identities.py --streams 1000
	$(BIN)/python benchmarks/live_cell.py
	$(BIN)/python benchmarks/desk_filter.py
	$(BIN)/python benchmarks/desk.py
	$(BIN)/python benchmarks/capture.py rate
	$(BIN)/python benchmarks/capture.py walks
	$(BIN)/python benchmarks/view.py

# errors and coverage of every estimator over simulated and measured walks: about half an hour
scoreboard: .venv/dev.stamp
	$(BIN)/python benchmarks/accuracy.py

# whether regions and verdicts are true: antennas of any height, small errors, device and desktop; ten minutes
truth: .venv/dev.stamp
	$(BIN)/python benchmarks/measured.py
	$(BIN)/python benchmarks/height.py
	$(BIN)/python benchmarks/stability.py --stride 3
	$(BIN)/python benchmarks/agreement.py

# false alarms and detection of the rules of suspicion, on ../shared/cells and ../shared/corpus: half
# an hour, or what a stopped one left over
SUSPICION = $(addprefix dist/suspicion/,rates stations walks-3 walks-10 walks-30 takeovers)
SUSPICION_CODE = $(wildcard benchmarks/suspicion*.py logger/core/suspicion/*.py)

suspicion: $(SUSPICION)
	tail -n +1 $^

$(SUSPICION): dist/suspicion/%: $(SUSPICION_CODE) | .venv/dev.stamp
	mkdir -p $(@D)
	PYTHONPATH=. $(BIN)/python benchmarks/suspicion.py $(subst -, --walks ,$*) --cities 24 > $@.part
	mv $@.part $@

# closed loops of guidance and of its peers, 100 worlds of each noise: some hours
guidance: .venv/dev.stamp
	$(BIN)/python benchmarks/guidance.py
	$(BIN)/python benchmarks/guidance.py --searches 20

# a synthetic city: cost of a survey, coverage, loggers that lie; some minutes
city: .venv/dev.stamp
	PYTHONPATH=. $(BIN)/python benchmarks/city.py

# the pages of docs/ as a static site in dist/docs, without a network; warnings are errors
docs: .venv/docs.stamp
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs dist/docs

.venv/docs.stamp: .venv/pip.stamp pyproject.toml
	$(BIN)/pip install --disable-pip-version-check -e '.[docs]'
	touch $@

.venv/pip.stamp:
	$(PYTHON) -m venv .venv
	touch $@

.venv/post.stamp: .venv/pip.stamp pyproject.toml
	$(BIN)/pip install --disable-pip-version-check -e '.[page,view]'
	touch $@

.venv/dev.stamp: .venv/pip.stamp pyproject.toml
	$(BIN)/pip install --disable-pip-version-check -e '.[dev]'
	touch $@ .venv/post.stamp

.venv/oldest.stamp: .venv/pip.stamp pyproject.toml Makefile
	$(PYTHON) -m venv .venv/oldest
	.venv/oldest/bin/pip install --disable-pip-version-check $(OLDEST) pytest hypothesis -e .
	touch $@

clean:
	rm -rf .venv dist $(DEMO)
