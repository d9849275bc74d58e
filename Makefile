# Everything lives in .venv/; nothing else is installed. The README has the same steps for
# a machine without make.
.DELETE_ON_ERROR:
.PHONY: campaign test quick docs report published bench evidence integrity proof check clean wheel

SHELL := bash
PYTHON ?= python3
CORES ?= 2
SET ?= proof
ITEMS ?= 600
BIN := .venv/bin
RUN := PATH="$(CURDIR)/$(BIN):$$PATH" OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

campaign: .venv/installed
	$(RUN) snakemake --cores $(CORES)

test: .venv/installed
	$(RUN) pytest -q -n $(CORES)

# What to run while you work: all but the tests of more than half a second of processor.
quick: .venv/installed
	$(RUN) pytest -q -n $(CORES) -m "not slow"

# The pages in docs/ as HTML in docs/_build; their commands are executed, warnings are errors.
docs: .venv/installed-docs
	$(RUN) sphinx-build -q -W --keep-going -j $(CORES) -b html -d docs/_build/doctrees docs docs/_build/html
	@echo "docs/_build/html/index.html"

report: .venv/installed
	$(RUN) snakemake --cores $(CORES)
	$(RUN) snakemake --report results/snakemake-report.html

# Campaigns in print since 1786 (docs/published.md), with a figure each in results/published/.
published: .venv/installed
	mkdir -p results/published
	$(RUN) bash -c 'for each in examples/published/*/; do \
		pendpipe published --figure "results/published/$$(basename $$each).svg" $$each; echo; done'

bench: .venv/installed-bench
	$(RUN) python -m benchmarks speed

evidence: .venv/installed-bench
	$(RUN) python -m benchmarks judge

# What interruptions and hostile input cost (docs/evidence.md): hours; goes on where it was stopped.
integrity: .venv/installed
	$(RUN) python -m benchmarks robustness

# Conceal, solve, open, score, and write results/challenge/SET/scores/proof.md; goes on where it was interrupted.
# A set is made once: SET=another makes another, with a seed of its own.
proof: .venv/installed
	$(RUN) PENDPIPE_CHALLENGE_SET=$(SET) PENDPIPE_CHALLENGE_ITEMS=$(ITEMS) \
		snakemake --cores $(CORES) challenge

# What CI asks besides the tests.
check: .venv/installed
	$(RUN) ruff check .
	$(RUN) ruff format --check .
	$(RUN) mypy
	$(RUN) snakefmt --check Snakefile workflow
	$(RUN) snakemake --lint

.venv/installed: pyproject.toml setup.py challenge/pyproject.toml constraints.txt
	@echo "setting up .venv/ (some minutes: the engine is compiled on the way)"
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[dev]" --editable ./challenge
	$(BIN)/python -m pendpipe.warm_up
	touch $@

.venv/installed-bench: .venv/installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[dev,bench]" --editable ./challenge
	touch $@

.venv/installed-docs: .venv/installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[dev,docs]"
	touch $@

# Brings the engine's machine code along (setup.py), so that a first call need not compile.
wheel: .venv/installed
	rm -rf build
	$(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist .

# Raw files of an instrument (results/RECORD/raw) can't be made again: they stay.
clean:
	rm -rf .snakemake .mypy_cache .ruff_cache .pytest_cache .hypothesis docs/_build
	find results -mindepth 1 ! -type d ! -path 'results/*/raw/*' ! -path results/README.md -delete
	find results -mindepth 1 -type d -empty -delete
