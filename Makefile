# What a user types. Everything real happens in scripts/setup.sh, CMakeLists.txt and the Python package.
#   make setup      system packages where missing, .venv, editable install, incremental build
#   make demo       all methods beside full over the relief of the Earth, ends with the path of the report
#   make test       C++ tests, then Python tests; skips are listed by reason
#   make lint       ruff, import-linter, clang-format, and a build in which compiler warnings are errors
#   make format     apply ruff's and clang-format's formatting
#   make notebooks  the notebooks at full scale, into runs/notebooks
#   make bench      all benchmarks against benchmarks/bars.toml
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
PYTHON_VENV := .venv/bin/python
EDITABLE := build/editable
CXX_FILES = $$(git ls-files --cached --others --exclude-standard 'cpp/*.h' 'cpp/*.cpp' 'tests/*.h' 'tests/*.cpp')

.PHONY: all setup demo test lint format notebooks bench clean
all: setup

setup:
	@scripts/setup.sh

# Asia and the seas to its south-east, heights four times as they are; lodlab bench demo times the same line.
demo: setup
	.venv/bin/lodlab compare earth:window=240/600/1300/1700,vertical_scale=4 --path orbit --size 960x540 \
	  --pixel-errors 1,2,4 --frames 30 --accuracy-frames 4 --out runs/demo

test: setup
	cmake --build $(EDITABLE) --target cpp_tests
	ctest --test-dir $(EDITABLE) --output-on-failure --parallel $$(nproc)
	$(PYTHON_VENV) -m pytest -n $$(nproc) --dist loadscope --no-loadscope-reorder

# With LODLAB_WERROR=ON (continuous integration) set-up has built with warnings as errors already.
lint: setup
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/lint-imports --no-logo --no-cache
	.venv/bin/clang-format --dry-run -Werror $(CXX_FILES)
	if [ "$${LODLAB_WERROR:-OFF}" != ON ]; then \
	  cmake -S . -B build/lint -G Ninja -DLODLAB_WERROR=ON -DPython_EXECUTABLE=$$PWD/$(PYTHON_VENV) \
	    -DCMAKE_PREFIX_PATH=$$($(PYTHON_VENV) -m pybind11 --cmakedir) && \
	  cmake --build build/lint --target all cpp_tests; \
	else cmake --build $(EDITABLE) --target cpp_tests; fi

format: setup
	.venv/bin/ruff check --fix-only .
	.venv/bin/ruff format .
	.venv/bin/clang-format -i $(CXX_FILES)

notebooks: setup
	LODLAB_SCALE=full $(PYTHON_VENV) scripts/run_notebooks.py notebooks/*.ipynb

bench: setup
	.venv/bin/lodlab bench --check

clean:
	rm -rf build .venv runs .pytest_cache .ruff_cache .hypothesis
