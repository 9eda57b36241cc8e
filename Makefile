# Every target sets up .venv by itself: `make demo` and `make test` are the two commands.
PYTHON ?= python3
BIN := .venv/bin

# Tests start hundreds of processes: each would compile the sources that have no bytecode.
test test-long: export PYTHONDONTWRITEBYTECODE =
# One process for each core: threads of their own for small matrices would only take turns.
test test-long: export OPENBLAS_NUM_THREADS = 1

.PHONY: install demo test test-long lint bench wheels clean

install: .venv/installed

.venv/installed: pyproject.toml core/pyproject.toml service/pyproject.toml clients/python/pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --constraint constraints.txt \
		--editable core --editable clients/python --editable service --group dev
	touch $@

demo: install
	$(BIN)/lineloom demo

# A file's tests stay together, in one process of one more than there are cores.
test: install
	$(BIN)/python -m pytest --numprocesses=auto --dist=loadfile --no-loadscope-reorder

test-long: install
	$(BIN)/python -m pytest -m long

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: install
	$(BIN)/python -m tests.benchmarks.run

wheels: install
	.ci/wheels

clean:
	rm -rf .venv out dist
