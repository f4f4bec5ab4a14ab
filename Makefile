# `make demo` and `make test` need Python 3.11, make and git; the rest is set up in .venv* here.
#
#   make demo      Suzanne with a 4-RoSy field, baked and rendered: demo.png
#   make test      unit tests with new numpy, the quick ones with old numpy, and tests with
#                  Blender 4.2's Python module
#   make test-all  the same, and Blender 4.5's and 5.0's modules
#   make test-long what else there is to be tested, in minutes rather than seconds a test
#   make check     formatting, lint, import rules and unit tests: seconds
#   make zip       the extension for Blender: dist/rosy-VERSION.zip
#   make gallery   the pictures of docs/gallery
#   make bench     every claim about speed, measured: minutes; dist/bench.json
#   make clean     everything made here, but for the environments (make distclean: these too)

PYTHON ?= python3.11
PYTEST  = -m pytest -p no:cacheprovider

UNIT   = .venv/bin/python
NUMPY1 = .venv-numpy1/bin/python
BPY42  = .venv-bpy42/bin/python

export PIP_DISABLE_PIP_VERSION_CHECK = 1
export PYTHONDONTWRITEBYTECODE = 1

.PHONY: demo test test-all test-long test-unit test-numpy1 test-bpy42 test-bpy45 test-bpy50 check lint format zip gallery bench clean distclean
.DELETE_ON_ERROR:

demo: .venv-bpy42/ready
	$(BPY42) examples/demo.py demo.png

test: test-unit test-numpy1 test-bpy42

test-all: test test-bpy45 test-bpy50

test-long: .venv/ready .venv-bpy42/ready
	$(UNIT) $(PYTEST) -m long tests/unit
	$(BPY42) $(PYTEST) -m long tests/bpy

test-unit: .venv/ready .venv-numpy1/ready
	ROSY_OTHER_PYTHON=$(abspath $(NUMPY1)) $(UNIT) $(PYTEST) tests/unit

test-numpy1: .venv-numpy1/ready
	$(NUMPY1) $(PYTEST) -m "not slow and not long" tests/unit

test-bpy42 test-bpy45 test-bpy50: test-bpy%: .venv-bpy%/ready
	.venv-bpy$*/bin/python $(PYTEST) tests/bpy

check: lint
	$(UNIT) $(PYTEST) -m "not slow and not long" tests/unit

lint: .venv/ready
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .

format: .venv/ready
	.venv/bin/ruff format .
	.venv/bin/ruff check --fix .

zip: .venv-bpy42/ready
	$(BPY42) tools/build_zip.py dist

gallery: .venv-gallery/ready
	.venv-gallery/bin/python -m tools.gallery

bench: .venv-bench/ready
	.venv-bench/bin/python bench/run.py --json dist/bench.json

# An environment is ready once all that its list of requirements names is installed.
.venv/ready: tools/requirements/unit.txt
.venv-%/ready: tools/requirements/%.txt
	$(make-environment)
.venv/ready:
	$(make-environment)

define make-environment
	@$(PYTHON) tools/check_python.py $<
	rm -rf $(@D)
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/python -m pip install --quiet --requirement $<
	touch $@
endef

clean:
	rm -rf demo.png dist build .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -not -path './.venv*' -prune -exec rm -rf {} +

distclean: clean
	rm -rf .venv .venv-*
