# `make demo`, `make check` and `make test` need Python 3.11, make and git; the rest is set up in .venv* here.
#
#   make demo      Suzanne with a 4-RoSy field, baked and rendered: demo.png
#   make format    format the code
#   make check     check format, lint and types, and run the quick unit tests: before each commit
#
# Lanes of tests; each runs the tests of TESTS alone if that is given:
#
#   make test      the unit tests, and the tests with the oldest Blender: `test-unit` and `test-oldest`
#   make test-newest   the main job with the newest Blender for this Python
#   make test-package  the Python package as it is installed, and what needs other libraries;
#                      make test-wheel PYTHON=python3.13: the installed package with another Python
#   make site      the site of the documentation with its notebooks, tested: dist/site
#
# LONG=1 adds cases to a lane that take minutes. Full Blenders are tested by tests/blender/run.py.
#
#   make fuzz      random hostile files and options, for FUZZ_SECONDS from FUZZ_SEED on
#   make monkey    random actions in a full Blender: make monkey BLENDER=/path/to/blender
#   make translations  update the texts in rosy_addon/ui/locale/*.po
#   make zip       the extension for Blender: dist/rosy-VERSION.zip
#   make dist      all files of a release: zip, wheel, sdist and dist/SHA256SUMS
#   make gallery   the pictures of docs/gallery
#   make bench     every claim about speed, measured: minutes; dist/bench.json
#   make clean     remove what was made here, but not the environments (make distclean: these too)

PYTHON ?= python3.11
# Processes of a test run: `make test JOBS=1` for one, `auto` for one per core.
JOBS   ?= auto
TESTS  ?=
LONG   ?=
# Random cases: how long, and the seed of the first one.
FUZZ_SECONDS ?= 600
FUZZ_SEED    ?= 1

# The folder of programs in an environment.
ifeq ($(OS),Windows_NT)
BIN = Scripts
else
BIN = bin
endif
DEV    = .venv/$(BIN)/python
OLDEST = .venv-bpy42/$(BIN)/python
NEWEST = .venv-bpy50/$(BIN)/python
EXTRAS = .venv-extras/$(BIN)/python
DIST   = .venv-dist/$(BIN)/python

PYTEST = -m pytest -p no:cacheprovider --numprocesses $(JOBS) --dist worksteal
QUICK  = $(PYTEST) -m "not slow and not long"
CASES  = $(if $(LONG),-m "long or not long")

export PIP_DISABLE_PIP_VERSION_CHECK = 1
# Tests start many processes: bytecode in __pycache__ saves half of the time until a test starts.
unexport PYTHONDONTWRITEBYTECODE

# Tests run in a process per core. Threads of these, for linear algebra and for software OpenGL, only wait
# for each other, which may take ten times as long.
test-quick test-unit test-oldest test-newest test-extras test-notebooks: export OPENBLAS_NUM_THREADS = 1
test-quick test-unit: export LP_NUM_THREADS = 0

.PHONY: demo format check lint test-quick test test-unit test-oldest test-newest test-package test-wheel \
        test-extras test-notebooks site fuzz monkey translations zip dist check-tag gallery bench clean distclean
.DELETE_ON_ERROR:

demo: .venv-bpy42/ready
	$(OLDEST) examples/demo.py demo.png

format: .venv/ready
	.venv/$(BIN)/ruff format .
	.venv/$(BIN)/ruff check --fix .

check: lint test-quick

lint: .venv/ready
	.venv/$(BIN)/ruff format --check .
	.venv/$(BIN)/ruff check .
	.venv/$(BIN)/mypy
	$(DEV) -m check_jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(DEV) -m check_jsonschema --builtin-schema vendor.github-issue-config \
		.github/ISSUE_TEMPLATE/config.yml
	$(DEV) -m check_jsonschema --builtin-schema vendor.github-issue-forms \
		$(filter-out %/config.yml,$(wildcard .github/ISSUE_TEMPLATE/*.yml))
	$(DEV) -m check_jsonschema --builtin-schema vendor.citation-file-format CITATION.cff

test-quick: .venv/ready
	$(DEV) $(QUICK) $(or $(TESTS),tests/unit)

test: test-unit test-oldest

test-unit: .venv/ready .venv-bpy42/ready
	ROSY_OTHER_PYTHON=$(abspath $(OLDEST)) $(DEV) $(PYTEST) $(CASES) $(or $(TESTS),tests/unit)

# The oldest Blender has the oldest numpy that RoSy supports. The quick unit tests of these rooms run with
# it; what draws is covered by tests/bpy, and by `test_numpy_versions.py` in the unit lane.
OLD_NUMPY = tests/unit/field tests/unit/line_drawing tests/unit/image_io
test-oldest: .venv-bpy42/ready
	$(OLDEST) $(PYTEST) $(CASES) $(or $(TESTS),tests/bpy)
	$(if $(TESTS),,$(OLDEST) $(QUICK) $(OLD_NUMPY))

test-newest: .venv-bpy50/ready
	$(NEWEST) $(PYTEST) --numprocesses 0 $(CASES) $(or $(TESTS),tests/bpy/test_smoke.py)

test-package: test-wheel test-extras

# The wheel is built twice, from the tree and from the sdist, and installed with numpy alone. Its tests
# run outside of the tree. The types are those that the programs of users see.
WHEEL_VENV = .venv-wheel-$(shell $(PYTHON) -c "import sys; print('%d.%d' % sys.version_info[:2])")
.SECONDEXPANSION:
test-wheel: .venv-dist/ready $$(WHEEL_VENV)/ready
	rm -rf build/wheel
	$(DIST) -m build --no-isolation --wheel --outdir build/wheel/tree . >/dev/null
	$(DIST) -m build --no-isolation --outdir build/wheel/sdist . >/dev/null
	$(WHEEL_VENV)/$(BIN)/python -m pip uninstall --quiet --yes rosyfields
	$(WHEEL_VENV)/$(BIN)/python -m pip install --quiet build/wheel/tree/*.whl
	cd .. && $(abspath $(WHEEL_VENV))/$(BIN)/python -P -m pytest $(abspath tests/wheel)
	cd build/wheel && $(abspath $(WHEEL_VENV))/$(BIN)/python -P $(abspath tests/wheel/examples.py) examples.py
	$(WHEEL_VENV)/$(BIN)/mypy --strict --config-file= --explicit-package-bases build/wheel/examples.py

test-extras: .venv-extras/ready
	$(EXTRAS) $(PYTEST) $(or $(TESTS),tests/extras)

# The notebooks, and the reference of the site, use the package as it is installed, from the tree.
test-notebooks: .venv-extras/ready
	$(EXTRAS) -m pip install --quiet --no-deps --no-build-isolation --force-reinstall .
	$(EXTRAS) $(PYTEST) tests/notebooks

site: test-notebooks
	NO_MKDOCS_2_WARNING=1 $(EXTRAS) -m mkdocs build --strict
	$(EXTRAS) tools/site/check.py dist/site

fuzz: .venv-extras/ready
	$(EXTRAS) -m tests.fuzz --seed $(FUZZ_SEED) --seconds $(FUZZ_SECONDS)

translations: .venv-bpy42/ready
	$(OLDEST) -m tools.translations

zip: .venv-bpy42/ready
	$(OLDEST) tools/build_zip.py dist

# Before a release: make check-tag TAG=vVERSION
check-tag:
	$(PYTHON) tools/check_tag.py "$(TAG)"

# The same commit gives the same bytes, in any folder: all files in the archives have a fixed time.
dist: .venv-dist/ready .venv-bpy42/ready
	rm -f dist/*.zip dist/*.whl dist/*.tar.gz dist/SHA256SUMS
	$(OLDEST) tools/build_zip.py dist
	$(DIST) -m build --no-isolation --outdir dist .
	$(DIST) -m twine check --strict dist/*.whl dist/*.tar.gz
	cd dist && LC_ALL=C sha256sum *.zip *.whl *.tar.gz > SHA256SUMS

# Seeds MONKEY_SEED, MONKEY_SEED + 1 and so on.
MONKEY_SEED  ?= 1
MONKEY_SEEDS ?= 1
MONKEY_STEPS ?= 400
BLENDER      ?= blender

monkey: zip
	$(OLDEST) tests/blender/monkey.py dist/*.zip --blender "$(BLENDER)" \
	    --seed $(MONKEY_SEED) --seeds $(MONKEY_SEEDS) --steps $(MONKEY_STEPS)

gallery: .venv-gallery/ready
	.venv-gallery/$(BIN)/python -m tools.gallery

bench: .venv-bpy50/ready
	$(NEWEST) bench/run.py --json dist/bench.json

# An environment is ready once all that its list of requirements names is installed.
.venv/ready: tools/requirements/dev.txt
	$(make-environment)
.venv-wheel-%/ready: tools/requirements/wheel.txt
	$(make-environment)
.venv-%/ready: tools/requirements/%.txt
	$(make-environment)

define make-environment
	@$(PYTHON) tools/check_python.py $<
	rm -rf $(@D)
	$(PYTHON) -m venv $(@D)
	$(@D)/$(BIN)/python -m pip install --quiet --requirement $<
	touch $@
endef

clean:
	rm -rf demo.png dist build .ruff_cache .mypy_cache .pytest_cache .hypothesis
	find . -name __pycache__ -not -path './.venv*' -prune -exec rm -rf {} +

distclean: clean
	rm -rf .venv .venv-*
