# `make demo` and `make test` need Python 3.11, make and git; the rest is set up in .venv* here.
#
#   make demo      Suzanne with a 4-RoSy field, baked and rendered: demo.png
#   make format    format the code
#   make check     check format, lint and types, and run the quick unit tests
#   make test      all unit tests, the quick ones with old numpy as well, and the tests with
#                  Blender 4.2's Python module
#   make test-extras  the tests of what needs other libraries: the files of simulations, figures
#   make smoke     the main job with Blender 4.5's and 5.0's modules
#   make test-all  `make test`, and all tests with Blender 4.5's and 5.0's modules
#   make test-notebooks  the notebooks, with the package as a user installs it
#   make test-bpy52    the tests with Blender 5.2's module: make test-bpy52 PYTHON313=python3.13
#   make test-wheel    the Python package as it is installed: make test-wheel PYTHON=python3.13
#   make test-python   the quick unit tests with another Python: make test-python PYTHON=python3.13
#   make test-long further cases of some tests, which take minutes
#   make fuzz      random hostile files, options and scenes, for FUZZ_SECONDS from FUZZ_SEED on
#   make fuzz-readers  the readers of all file formats, guided by coverage
#   make monkey    random actions in a full Blender: make monkey BLENDER=/path/to/blender
#   make zip       the extension for Blender: dist/rosy-VERSION.zip
#   make dist      all files of a release: zip, wheel, sdist and dist/SHA256SUMS
#   make gallery   the pictures of docs/gallery
#   make site      the site of the documentation: dist/site
#   make bench     every claim about speed, measured: minutes; dist/bench.json
#   make clean     remove what was made here, but not the environments (make distclean: these too)

PYTHON ?= python3.11
# For Blender 5.1 and later.
PYTHON313 ?= python3.13
# Processes of a test run: `make test JOBS=1` for one, `auto` for one per core.
JOBS   ?= auto
# Random cases: how long, and the seed of the first one.
FUZZ_SECONDS ?= 600
FUZZ_SEED    ?= 1
PYTEST  = -m pytest -p no:cacheprovider --numprocesses $(JOBS) --dist worksteal

# The folder of programs in an environment.
ifeq ($(OS),Windows_NT)
BIN = Scripts
else
BIN = bin
endif
UNIT  = .venv/$(BIN)/python
BPY42 = .venv-bpy42/$(BIN)/python

export PIP_DISABLE_PIP_VERSION_CHECK = 1
export PYTHONDONTWRITEBYTECODE = 1

# Tests run in a process per core. Threads of these, for linear algebra and for software OpenGL, only wait
# for each other, which may take ten times as long.
check test-unit test-old-numpy test-bpy42 test-bpy45 test-bpy50 test-bpy52 test-long test-numeric \
test-python test-extras test-notebooks: export OPENBLAS_NUM_THREADS = 1
check test-unit test-long test-python: export LP_NUM_THREADS = 0

.PHONY: demo check lint format test test-unit test-old-numpy test-bpy42 test-bpy45 test-bpy50 \
        test-bpy52 smoke smoke-bpy45 smoke-bpy50 test-all test-long test-numeric test-python test-wheel \
        test-extras test-notebooks fuzz fuzz-readers monkey zip dist check-tag gallery site \
        bench clean distclean
.DELETE_ON_ERROR:

demo: .venv-bpy42/ready
	$(BPY42) examples/demo.py demo.png

test: test-unit test-old-numpy test-bpy42

test-all: test test-bpy45 test-bpy50

smoke: smoke-bpy45 smoke-bpy50

test-long: .venv/ready .venv-bpy42/ready
	$(UNIT) $(PYTEST) -m long tests/unit
	$(BPY42) $(PYTEST) -m long tests/bpy

test-unit: .venv/ready .venv-bpy42/ready
	ROSY_OTHER_PYTHON=$(abspath $(BPY42)) $(UNIT) $(PYTEST) tests/unit

# Blender 4.2 has the oldest numpy that RoSy supports.
test-old-numpy: .venv-bpy42/ready
	$(BPY42) $(PYTEST) -m "not slow and not long" tests/unit

test-bpy42 test-bpy45 test-bpy50 test-bpy52: test-bpy%: .venv-bpy%/ready
	.venv-bpy$*/$(BIN)/python $(PYTEST) tests/bpy

test-extras: .venv-extras/ready
	.venv-extras/$(BIN)/python $(PYTEST) tests/extras

smoke-bpy45 smoke-bpy50: smoke-bpy%: .venv-bpy%/ready
	.venv-bpy$*/$(BIN)/python $(PYTEST) --numprocesses 0 tests/bpy/test_smoke.py

# The rooms that need only numpy, on systems without Blender's module.
NUMERIC_ROOMS = field projection compositor line_drawing surface_texture image_io preset_files
test-numeric: .venv/ready
	$(UNIT) $(PYTEST) -m "not slow and not long" $(NUMERIC_ROOMS:%=tests/unit/%)

# The package is installed as `rosyfields` from the tree.
test-notebooks: .venv-extras/ready
	.venv-extras/$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation \
		--force-reinstall .
	.venv-extras/$(BIN)/python $(PYTEST) tests/notebooks
# Environments of one version of Python each: .venv-wheel-3.13, .venv-unit-3.13.
PYTHON_VERSION = $(shell $(PYTHON) -c "import sys; print('%d.%d' % sys.version_info[:2])")
WHEEL_VENV     = .venv-wheel-$(PYTHON_VERSION)
UNIT_VENV      = .venv-unit-$(PYTHON_VERSION)

.SECONDEXPANSION:
# The wheel is built twice, from the tree and from the sdist, and installed with numpy alone. Its tests
# run outside of the tree. The types are those that the programs of users see.
test-wheel: .venv-dist/ready .venv-types/ready $$(WHEEL_VENV)/ready
	rm -rf build/wheel
	.venv-dist/$(BIN)/python -m build --no-isolation --wheel --outdir build/wheel/tree . >/dev/null
	.venv-dist/$(BIN)/python -m build --no-isolation --outdir build/wheel/sdist . >/dev/null
	$(WHEEL_VENV)/$(BIN)/python -m pip uninstall --quiet --yes rosyfields
	$(WHEEL_VENV)/$(BIN)/python -m pip install --quiet build/wheel/tree/*.whl
	cd .. && $(abspath $(WHEEL_VENV))/$(BIN)/python -P -m pytest $(abspath tests/wheel)
	cd build/wheel && $(abspath $(WHEEL_VENV))/$(BIN)/python -P $(abspath tests/wheel/examples.py) examples.py
	.venv-types/$(BIN)/mypy --strict --config-file= --explicit-package-bases \
		--python-executable $(WHEEL_VENV)/$(BIN)/python build/wheel/examples.py
test-python: $$(UNIT_VENV)/ready
	$(UNIT_VENV)/$(BIN)/python $(PYTEST) -m "not slow and not long" tests/unit

check: lint
	$(UNIT) $(PYTEST) -m "not slow and not long" tests/unit

lint: .venv/ready .venv-types/ready
	.venv/$(BIN)/ruff format --check .
	.venv/$(BIN)/ruff check .
	.venv-types/$(BIN)/mypy
	$(UNIT) -m check_jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(UNIT) -m check_jsonschema --builtin-schema vendor.github-issue-config \
		.github/ISSUE_TEMPLATE/config.yml
	$(UNIT) -m check_jsonschema --builtin-schema vendor.github-issue-forms \
		$(filter-out %/config.yml,$(wildcard .github/ISSUE_TEMPLATE/*.yml))
	$(UNIT) -m check_jsonschema --builtin-schema vendor.citation-file-format CITATION.cff

format: .venv/ready
	.venv/$(BIN)/ruff format .
	.venv/$(BIN)/ruff check --fix .

fuzz: .venv/ready .venv-bpy42/ready
	$(UNIT) -m tests.fuzz --seed $(FUZZ_SEED) --seconds $$(($(FUZZ_SECONDS) / 2))
	$(BPY42) -m tests.fuzz --seed $(FUZZ_SEED) --seconds $$(($(FUZZ_SECONDS) / 2)) \
		--category scenes --category animations

# The readers of all formats, guided by coverage; dist/fuzz-readers keeps the inputs.
READER_KINDS = .obj .off .ply .stl .rosy .rawfield .txt .npy .sings guides.txt .png .json
fuzz-readers: $(READER_KINDS:%=fuzz-reader-%)
fuzz-reader-%: .venv-fuzz/ready
	.venv-fuzz/$(BIN)/python -m tests.fuzz.readers $* dist/fuzz-readers/$* -max_len=3000 \
		-max_total_time=$$(($(FUZZ_SECONDS) / 12)) -artifact_prefix=dist/fuzz-readers/fault-$*-

zip: .venv-bpy42/ready
	$(BPY42) tools/build_zip.py dist

# Before a release: make check-tag TAG=vVERSION
check-tag:
	$(PYTHON) tools/check_tag.py "$(TAG)"

# The same commit gives the same bytes, in any folder: all files in the archives have a fixed time.
dist: .venv-dist/ready .venv-bpy42/ready
	rm -f dist/*.zip dist/*.whl dist/*.tar.gz dist/SHA256SUMS
	$(BPY42) tools/build_zip.py dist
	.venv-dist/$(BIN)/python -m build --no-isolation --outdir dist .
	.venv-dist/$(BIN)/python -m twine check --strict dist/*.whl dist/*.tar.gz
	cd dist && LC_ALL=C sha256sum *.zip *.whl *.tar.gz > SHA256SUMS

# Seeds MONKEY_SEED, MONKEY_SEED + 1 and so on; MONKEY_OPTIONS=--window for a window.
MONKEY_SEED    ?= 1
MONKEY_SEEDS   ?= 1
MONKEY_STEPS   ?= 400
MONKEY_OPTIONS ?=
BLENDER        ?= blender

monkey: zip
	.venv-bpy42/$(BIN)/python tests/blender/monkey.py dist/*.zip --blender "$(BLENDER)" \
	    --seed $(MONKEY_SEED) --seeds $(MONKEY_SEEDS) --steps $(MONKEY_STEPS) $(MONKEY_OPTIONS)

gallery: .venv-gallery/ready
	.venv-gallery/$(BIN)/python -m tools.gallery

# The reference is that of the package as users install it.
site: .venv-site/ready test-notebooks
	.venv-site/$(BIN)/python -m pip install --quiet --force-reinstall --no-deps --no-build-isolation .
	NO_MKDOCS_2_WARNING=1 .venv-site/$(BIN)/python -m mkdocs build --strict
	.venv-site/$(BIN)/python tools/site/check.py dist/site

bench: .venv-bench/ready
	.venv-bench/$(BIN)/python bench/run.py --json dist/bench.json

# An environment is ready once all that its list of requirements names is installed.
.venv/ready: tools/requirements/unit.txt
.venv-%/ready: tools/requirements/%.txt
	$(make-environment)
.venv-unit-%/ready: tools/requirements/unit.txt
	$(make-environment)
.venv-wheel-%/ready: tools/requirements/wheel.txt
	$(make-environment)
.venv-bpy52/ready: PYTHON = $(PYTHON313)
.venv/ready:
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
